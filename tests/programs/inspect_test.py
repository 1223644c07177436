"""roadvec-inspect on drives, bare captures, CAN logs and IMU recordings."""

import gzip
import json
import math
import struct
import xml.etree.ElementTree

import programs
from programs import DRIVE, RECORDINGS, ProgramTest, drive_toml, run, write_pcap_start

HEADER = "sweep,x_m,y_m,z_m,intensity,t_ns,laser,return"
PACKETS = 700  # two revolutions of an HDL-64E


def recording(name):
    path = RECORDINGS / name
    if not path.exists():
        print(f"skipped: no recordings ({path})")
        return None
    return path


class InspectTest(ProgramTest):
    def setUp(self):
        super().setUp()
        lidar = drive_toml()["lidar"]
        self.pcap = self.folder / "start.pcap"
        write_pcap_start(self.pcap, PACKETS)
        self.whose = ["--model", lidar["model"], "--calibration", DRIVE / lidar["calibration"]]

    def report(self, *arguments):
        result = run("roadvec-inspect", *arguments, "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def test_a_drive_can_be_simulated_with_the_coarse_can_of_the_papers_car(self):
        drive = self.folder / "coarse"
        result = run("roadvec-simulate", "scene_a", drive, "--lidar", "VLP-16", "--duration", 0.5, "--coarse-can")
        self.assertEqual(result.returncode, 0, result.stderr)
        dbc = (drive / "vehicle.dbc").read_text(encoding="utf-8")
        self.assertRegex(dbc, r"SteeringWheelAngle : \S+ \(1,0\)")
        self.assertRegex(dbc, r"WheelSpeedFL : \S+ \(1,0\)")

    def test_a_drive_is_described_in_words_and_in_json(self):
        result = run("roadvec-inspect", DRIVE)
        self.assertEqual(result.returncode, 0, result.stderr)
        for words in (drive_toml()["lidar"]["model"], "revolutions", "points", "received", "kernel_drops", "CAN ", "IMU ",
                      "moves with the speed"):
            self.assertIn(words, result.stdout)
        report = self.report(DRIVE)
        self.assertEqual(report["warnings"], [])
        lidar = report["lidar"]
        self.assertEqual(lidar["model"], drive_toml()["lidar"]["model"])
        self.assertEqual(lidar["seen_model"], drive_toml()["lidar"]["model"])
        self.assertAlmostEqual(lidar["stream"]["duration_s"], 8, delta=0.2)
        self.assertAlmostEqual(lidar["revolutions_per_s"], 10, delta=0.5)
        self.assertGreaterEqual(lidar["complete_revolutions"], 77)
        self.assertEqual(lidar["counters"]["wrong_flags"] + lidar["counters"]["wrong_length"], 0)
        self.assertFalse(lidar["damaged"])

    def test_can_signals_that_move_with_the_speed_are_found(self):
        vehicle = drive_toml()["vehicle"]
        report = self.report(DRIVE / vehicle["can"], "--dbc", DRIVE / vehicle["dbc"], "--speed",
                             vehicle["wheel_speed_signals"][0])["can"]
        moving = {f"{entry['message']}.{name}" for entry in report["ids"] for name, signal in entry.get("signals", {}).items()
                  if signal["moves_with_speed"]}
        self.assertLessEqual(set(vehicle["wheel_speed_signals"]), moving)
        self.assertNotIn(vehicle["steering_signal"], moving)
        for entry in report["ids"]:
            self.assertGreater(entry["stream"]["rate_hz"], 5)
            self.assertEqual(entry["stream"]["backward"], 0)
        without = self.report(DRIVE / vehicle["can"])["can"]
        self.assertEqual([entry["message"] for entry in without["ids"]], [""] * len(report["ids"]))

    def test_an_imu_log_is_described_and_its_protocol_found(self):
        imu = self.report(DRIVE / drive_toml()["imu"]["log"])["imu"]
        self.assertEqual(imu["protocol"], "xsens")
        self.assertGreater(imu["stream"]["rate_hz"], 50)
        self.assertEqual(imu["bad_checksums"] + imu["lost_messages"] + imu["bad_lines"], 0)
        self.assertGreater(imu["with_rate"], 100)
        packet = bytearray(72)
        packet[0], packet[21] = 0xE7, 4
        struct.pack_into("<i", packet, 9, -98_100 & 0xFFFFFF)
        packet[71] = sum(packet[1:71]) & 0xFF
        log = self.folder / "ncom.log"
        log.write_text("".join(f"({100 + i * 0.01:.6f}) {packet.hex()}\n" for i in range(200)), encoding="ascii")
        imu = self.report(log)["imu"]
        self.assertEqual(imu["protocol"], "ncom")
        self.assertAlmostEqual(imu["stream"]["rate_hz"], 100, delta=0.1)
        self.assertAlmostEqual(imu["mean_acceleration_mps2"], 9.81, delta=0.01)

    def test_a_revolution_is_drawn(self):
        svg = self.folder / "sweep.svg"
        self.report(self.pcap, *self.whose, "--svg", svg)
        root = xml.etree.ElementTree.parse(svg).getroot()
        paths = [element for element in root if element.tag.endswith("path")]
        self.assertGreater(len(paths), 2)
        self.assertGreater(sum(len(path.get("d")) for path in paths), 10_000)

    def test_a_compressed_capture_is_the_same(self):
        packed = self.folder / "start.pcap.gz"
        packed.write_bytes(gzip.compress(self.pcap.read_bytes()))
        plain, unpacked = self.report(self.pcap, *self.whose)["lidar"], self.report(packed, *self.whose)["lidar"]
        for key in ("points", "revolutions", "counters"):
            self.assertEqual(plain[key], unpacked[key])

    def test_models_are_told_by_how_their_packets_are_built(self):
        for name, seen, claimed, mode in (("hdl32e_monterey", "HDL-32E", None, None),
                                          ("vlp16_says_hdl32e", "VLP-16", "HDL-32E", None),
                                          ("vlp16_dual", "VLP-16", "VLP-16", "dual"),
                                          ("vlp32c", "VLP-32C", "VLP-32C", "strongest"),
                                          ("vls128", "VLS-128", "VLS-128", None),
                                          ("hdl64e_s3_dual_6_revolutions", "HDL-64E S3", None, "dual")):
            path = recording(f"velodyne/{name}.pcap")
            if not path:
                return
            with self.subTest(name=name):
                lidar = self.report(path)["lidar"]
                self.assertEqual(lidar["seen_model"], seen)
                if claimed:
                    self.assertEqual(lidar["claimed_model"], claimed)
                if mode:
                    self.assertEqual(lidar["return_mode"], mode)

    def test_the_clock_of_a_real_sensor_is_told(self):
        path = recording("velodyne/hdl32e_monterey.pcap")
        if not path:
            return
        clock = self.report(path)["lidar"]["clock"]
        self.assertEqual(clock["position_packets"], 299)
        self.assertTrue(clock["fix"] and clock["stamps_are_utc"])

    def test_the_points_of_a_capture_are_written_one_per_line(self):
        points = self.folder / "points.csv"
        report = self.report(self.pcap, *self.whose, "--points", points)["lidar"]
        self.assertEqual(report["counters"]["received"] + report["counters"]["position_packets"], PACKETS)
        header, *rows = points.read_text(encoding="ascii").splitlines()
        self.assertEqual(header, HEADER)
        self.assertEqual(len(rows), report["points"])
        self.assertGreater(len(rows), 10_000)
        times = []
        for row in rows:
            sweep, x_m, y_m, z_m, intensity, t_ns, laser, which = row.split(",")
            self.assertLess(int(sweep), report["revolutions"])
            self.assertLess(math.hypot(float(x_m), float(y_m), float(z_m)), 130)
            self.assertTrue(0 <= float(intensity) <= 255 and 0 <= int(laser) <= 63 and int(which) == 0, row)
            times.append(int(t_ns))
        self.assertAlmostEqual((max(times) - min(times)) * 1e-9, report["stream"]["duration_s"], delta=0.01)

    def test_points_to_standard_output_leave_the_report_to_standard_error(self):
        result = run("roadvec-inspect", self.pcap, *self.whose, "--points", "-")
        self.assertEqual(result.returncode, 0)
        self.assertTrue(result.stdout.startswith(HEADER + "\n"))
        self.assertIn("revolutions", result.stderr)

    def test_an_hdl64e_without_its_calibration_is_described_and_not_decoded(self):
        report = self.report(self.pcap)["lidar"]
        self.assertEqual(report["model"], "")
        self.assertEqual(report["seen_model"], "HDL-64E S2")
        self.assertIn("--calibration", report["not_decoded"])
        self.assertEqual(report["counters"]["received"], PACKETS)
        self.assert_refused(run("roadvec-inspect", self.pcap, "--svg", self.folder / "x.svg"), 1, "no sweep to draw")

    def test_two_sensors_on_one_port_are_told_apart(self):
        with open(self.pcap, "r+b") as file:  # every packet of the second half from another address
            data = bytearray(file.read())
            at, number = 24, 0
            while at < len(data):
                number += 1
                if number > PACKETS // 2 + 10:
                    data[at + 16 + 29] = 77
                at += 16 + struct.unpack_from("<I", data, at + 8)[0]
            file.seek(0)
            file.write(data)
        result = run("roadvec-inspect", self.pcap, *self.whose, "--json")
        self.assert_refused(result, 0, "more than one sensor", "--source")
        self.assertEqual(len(json.loads(result.stdout)["lidar"]["traffic"]), 2)
        other = [entry["source"] for entry in json.loads(result.stdout)["lidar"]["traffic"] if entry["source"].endswith("77")][0]
        one = self.report(self.pcap, *self.whose, "--source", other)["lidar"]
        self.assertEqual(one["counters"]["received"], PACKETS // 2 - 10)
        self.assert_refused(run("roadvec-inspect", self.pcap, "--source", "10.9.8.7"), 1, "10.9.8.7", other)

    def test_what_is_no_recording_is_refused(self):
        text = self.folder / "notes.txt"
        text.write_text("nothing of the kind\n", encoding="ascii")
        self.assert_refused(run("roadvec-inspect", text), 1, "notes.txt", "not a pcap", "candump")

    def test_another_model_than_recorded_is_refused(self):
        self.assert_refused(run("roadvec-inspect", self.pcap, "--model", "VLP-16"), 1, "VLP-16", "HDL-64E S2")
        self.assert_refused(run("roadvec-inspect", self.pcap, "--model", "HDL-65"), 1, "HDL-65", "unknown")

    def test_a_missing_file_is_named(self):
        self.assert_refused(run("roadvec-inspect", self.folder / "none.pcap", *self.whose), 1, "none.pcap")
        self.assert_refused(run("roadvec-inspect", self.pcap, "--model", "HDL-64E S2", "--calibration", "none.xml"), 1,
                            "none.xml")

    def test_a_truncated_capture_is_described_as_far_as_it_goes(self):
        write_pcap_start(self.pcap, PACKETS, part_bytes=500)
        result = run("roadvec-inspect", self.pcap, *self.whose, "--json")
        self.assert_refused(result, 0, "cut off")
        self.assertEqual(json.loads(result.stdout)["lidar"]["counters"]["received"], PACKETS)

    def test_wrong_usage_is_told_apart(self):
        self.assertEqual(run("roadvec-inspect").returncode, 2)
        self.assertEqual(run("roadvec-inspect", self.pcap, "--modle", "VLP-16").returncode, 2)


if __name__ == "__main__":
    programs.main()
