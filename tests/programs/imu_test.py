"""The same motion from IMUs that speak differently: MTData2, NCOM, and signals on the CAN bus."""

import math
import struct

import programs
from programs import DRIVE, ProgramTest, counters_of, drive_toml, read_json, run

DBC = """
BO_ 1904 YawSensor: 4 Imu
 SG_ YawRate : 0|32@1- (1e-06,0) [0|0] "rad/s" Car
"""


def xsens_rates():
    """(stamp as text, rates in rad/s) of the drive's own recording."""
    for line in (DRIVE / drive_toml()["imu"]["log"]).read_text(encoding="ascii").splitlines():
        stamp, text = line.split()
        data = bytes.fromhex(text)
        at = data.find(b"\x80\x20\x0c")
        if at >= 0:
            yield stamp, struct.unpack_from(">3f", data, at + 3)


def ncom_packet(time_ms, rates_radps):
    packet = bytearray(72)
    struct.pack_into("<BH", packet, 0, 0xE7, time_ms % 60_000)
    for i, (rate, sign) in enumerate(zip(rates_radps, (1, -1, -1))):
        packet[12 + 3 * i:15 + 3 * i] = round(sign * rate * 1e5).to_bytes(3, "little", signed=True)
    packet[21] = 1  # raw: rates alone
    packet[71] = sum(packet[1:71]) & 0xFF
    return bytes(packet)


class ImuTest(ProgramTest):
    def map_drive(self, drive, name):
        out = self.folder / name
        result = run("roadvecd", "--drive", drive, "--out", out)
        self.assertEqual(result.returncode, 0, result.stderr)
        report = read_json(out / "report.json")
        self.assertIn("yaw from imu", report["stages"]["mapping"]["detail"])
        self.assertGreater(report["keyframes"], 10)
        end = (out / "trajectory.tum").read_text(encoding="ascii").splitlines()[-1].split()
        return report, [float(value) for value in end[1:3]]

    def setUp(self):
        super().setUp()
        self.expected = self.map_drive(DRIVE, "xsens")[1]
        self.angles = {key: 0.0 for key in ("roll_deg", "pitch_deg", "yaw_deg")}

    def test_ncom_drives_as_xsens_does(self):
        drive = self.copy_of_drive(lambda tables: tables.update(imu={"protocol": "ncom", "log": "ncom.log", **self.angles}))
        (drive / "ncom.log").write_text("".join(
            f"{stamp} {ncom_packet(10 * i, rates).hex()}\n" for i, (stamp, rates) in enumerate(xsens_rates())), encoding="ascii")
        report, end = self.map_drive(drive, "ncom")
        self.assertEqual(counters_of(report, "imu")["bad_checksums"], 0)
        self.assertLess(math.dist(end, self.expected), 0.3)

    def test_an_imu_on_the_cars_bus_drives_as_xsens_does(self):
        drive = self.copy_of_drive(lambda tables: tables.update(
            imu={"protocol": "can", "rate_z_signal": "YawSensor.YawRate", **self.angles}))
        vehicle = drive_toml()["vehicle"]
        for name, text in ((vehicle["dbc"], (DRIVE / vehicle["dbc"]).read_text(encoding="utf-8") + DBC),
                           (vehicle["can"], self.with_yaw_rates((DRIVE / vehicle["can"]).read_text(encoding="ascii")))):
            (drive / name).unlink()
            (drive / name).write_text(text, encoding="utf-8")
        report, end = self.map_drive(drive, "can")
        self.assertGreater(counters_of(report, "imu")["frames"], 500)
        self.assertLess(math.dist(end, self.expected), 0.3)

    @staticmethod
    def with_yaw_rates(log):
        lines = log.splitlines()
        lines += [f"{stamp} can0 770#{struct.pack('<i', round(rates[2] * 1e6)).hex().upper()}" for stamp, rates in xsens_rates()]
        return "\n".join(sorted(lines, key=lambda line: float(line[1:line.index(")")]))) + "\n"

    def test_signals_that_are_not_there_are_named(self):
        drive = self.copy_of_drive(lambda tables: tables.update(
            imu={"protocol": "can", "rate_z_signal": "YawSensor.YawRate", **self.angles}))
        self.assert_refused(run("roadvecd", "--drive", drive, "--out", self.folder / "map"), 1, "YawSensor")


if __name__ == "__main__":
    programs.main()
