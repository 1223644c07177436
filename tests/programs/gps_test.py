"""The GPS receiver at the LiDAR: the state of the clock, and the anchor where the configuration has none."""

import functools
import json
import operator
import socket
import struct
import time

import programs
from programs import DRIVE, PCAP_HEADER_BYTES, RECORD_HEADER_BYTES, ProgramTest, drive_toml, free_udp_port, read_json, run, running

POSITION_BYTES, HEADERS_BYTES = 512, 42
PLACE = (49.5, 8.25)


def nmea(body):
    return f"${body}*{functools.reduce(operator.xor, body.encode()):02X}\r\n"


def rmc(status="A", knots=20.0, second=11):
    latitude, longitude = (f"{int(deg):0{width}d}{deg % 1 * 60:07.4f}" for deg, width in zip(PLACE, (2, 3)))
    return nmea(f"GPRMC,1302{second:02d},{status},{latitude},N,{longitude},E,{knots:05.1f},030.0,221126,,")


def position_packet(sentence, device_us, pps=2):
    packet = bytearray(POSITION_BYTES)
    struct.pack_into("<IB", packet, 198, device_us, pps)
    packet[206:206 + len(sentence)] = sentence.encode()
    return bytes(packet)


def write_pcap_with_positions(target, sentence_at, every=300):
    """The drive's capture with a position packet after each `every` data packets; sentence_at(number) is its text."""
    with open(DRIVE / drive_toml()["lidar"]["pcap"], "rb") as file, open(target, "wb") as out:
        out.write(file.read(PCAP_HEADER_BYTES))
        number = 0
        while header := file.read(RECORD_HEADER_BYTES):
            frame = file.read(struct.unpack_from("<I", header, 8)[0])
            out.write(header + frame)
            number += 1
            if number % every:
                continue
            payload = position_packet(sentence_at(number), 131_200_000 + number)
            headers = bytearray(frame[:HEADERS_BYTES])
            struct.pack_into(">H", headers, 16, 28 + POSITION_BYTES)
            struct.pack_into(">HHH", headers, 36, 8308, 8 + POSITION_BYTES, 0)
            length = HEADERS_BYTES + POSITION_BYTES
            out.write(header[:8] + struct.pack("<II", length, length) + bytes(headers) + payload)


class GpsTest(ProgramTest):
    def drive(self, sentence_at, **removed):
        def edit(tables):
            for table in removed:
                del tables[table]
        drive = self.copy_of_drive(edit)
        (drive / "lidar.pcap").unlink()
        write_pcap_with_positions(drive / "lidar.pcap", sentence_at)
        return drive

    def test_the_report_tells_the_state_of_the_clock(self):
        drive = self.drive(lambda number: rmc(status="A" if number > 3000 else "V"))
        result = run("roadvecd", "--drive", drive, "--out", self.folder / "map")
        self.assertEqual(result.returncode, 0, result.stderr)
        clock = read_json(self.folder / "map/report.json")["stages"]["clock"]
        self.assertIn("arrival, pps locked, nmea 13:02:11 UTC valid, stamps are UTC", clock["detail"])
        self.assertGreater(clock["counters"]["position_packets"], 50)
        self.assertEqual(clock["counters"]["nmea_bad"], 0)
        self.assertAlmostEqual(clock["gauges"]["device_after_nmea_s"], 0.2, delta=0.1)

    def test_a_missing_anchor_is_the_first_fix_of_a_vehicle_that_drives(self):
        def sentence_at(number):
            if number < 1500:
                return rmc(status="V")
            return rmc(knots=1.0, second=12) if number < 3000 else rmc(second=13)
        drive = self.drive(sentence_at, anchor=True)
        result = run("roadvecd", "--drive", drive, "--out", self.folder / "map")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertRegex(result.stderr, r"anchor from the sensor's GPS: 49\.5.* N, 8\.25.* E, .*yaw 60\.0")
        for feature in read_json(self.folder / "map/map.geojson")["features"]:
            for longitude_deg, latitude_deg, _ in feature["geometry"]["coordinates"]:
                self.assertAlmostEqual(latitude_deg, PLACE[0], delta=0.01)
                self.assertAlmostEqual(longitude_deg, PLACE[1], delta=0.01)

    def test_a_drive_without_anchor_and_without_a_fix_is_refused(self):
        drive = self.drive(lambda number: rmc(status="V"), anchor=True)
        result = run("roadvecd", "--drive", drive, "--out", self.folder / "map")
        self.assert_refused(result, 1, r"\[anchor\] is missing", "no fix", "latitude_deg")

    def test_the_daemon_listens_to_the_position_port(self):
        tables = self.car_tables()
        tables["lidar"]["position_port"] = free_udp_port()
        with running("roadvecd", "--config", self.car_file(tables)) as daemon:
            def clock():
                with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                    sender.sendto(position_packet(rmc(), 131_200_000, pps=0x95), ("127.0.0.1", tables["lidar"]["position_port"]))
                status = run("roadvec", "--socket", tables["server"]["socket"], "status", "--json")
                stages = json.loads(status.stdout)["stages"] if status.stdout else []
                return next((stage for stage in stages if stage["name"] == "clock"), None)
            end = time.monotonic() + 20
            while not ((found := clock()) and found["counters"]["position_packets"]) and time.monotonic() < end:
                time.sleep(0.2)
            self.assertIsNone(daemon.poll())
            self.assertIn("pps unknown, nmea 13:02:11 UTC valid", found["detail"])


if __name__ == "__main__":
    programs.main()
