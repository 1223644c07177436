"""A head that streams its own calibration: the simulated drive with the table put into its packets' status bytes."""

import struct
import xml.etree.ElementTree

import programs
from programs import DRIVE, PCAP_HEADER_BYTES, RECORD_HEADER_BYTES, ProgramTest, drive_toml, read_json, run

CYCLE = b"HMSDNYGTV1234567"
TABLE_BYTES = 1820
PACKET_BYTES = 1206


def streamed_table():
    """The drive's db.xml as an HDL-64E S2 sends it: hundredths of a degree, millimetres, tenths."""
    table = bytearray(TABLE_BYTES)
    table[:5] = b"UNIT#"
    for px in xml.etree.ElementTree.parse(DRIVE / drive_toml()["lidar"]["calibration"]).iter("px"):
        def field(name, scale):
            return round(float(px.findtext(name)) * scale)
        laser = int(px.findtext("id_"))
        struct.pack_into("<B9h2B", table, 7 + 28 * laser, laser, field("vertCorrection_", 100),
                         field("rotCorrection_", 100), field("distCorrection_", 10), field("distCorrectionX_", 10),
                         field("distCorrectionY_", 10), field("vertOffsetCorrection_", 10),
                         field("horizOffsetCorrection_", 10), field("focalDistance_", 10), field("focalSlope_", 10), 0, 255)
    struct.pack_into("<H", table, TABLE_BYTES - 2, TABLE_BYTES)
    return table


def write_streaming_pcap(target, lost_every):
    """The drive's capture with the table in it, less one packet in `lost_every`."""
    table = streamed_table()
    data = (DRIVE / drive_toml()["lidar"]["pcap"]).read_bytes()
    with open(target, "wb") as out:
        out.write(data[:PCAP_HEADER_BYTES])
        at, count = PCAP_HEADER_BYTES, 0
        while at < len(data):
            size = RECORD_HEADER_BYTES + struct.unpack_from("<I", data, at + 8)[0]
            record = bytearray(data[at:at + size])
            at += size
            if size < PACKET_BYTES:
                out.write(record)
                continue
            cycle, slot = divmod(count % (260 * 16), 16)
            record[-2] = CYCLE[slot]
            if slot >= 9:
                record[-1] = table[cycle * 7 + slot - 9]
            count += 1
            if count % lost_every != 0:
                out.write(record)


class StreamedTest(ProgramTest):
    def streaming_drive(self):
        drive = self.copy_of_drive(lambda tables: tables["lidar"].update(calibration="streamed"))
        (drive / "lidar.pcap").unlink()
        write_streaming_pcap(drive / "lidar.pcap", lost_every=101)
        return drive

    def test_a_drive_is_mapped_once_the_table_is_complete(self):
        result = run("roadvecd", "--drive", self.streaming_drive(), "--out", self.folder / "map")
        self.assertEqual(result.returncode, 0, result.stderr)
        report = read_json(self.folder / "map/report.json")
        put_off = programs.counters_of(report, "lidar")["uncalibrated"]
        # Two rounds of 4160 packets, and a third for what was lost in them.
        self.assertTrue(2 * 4160 <= put_off <= 4 * 4160, put_off)
        self.assertGreater(report["keyframes"], 0)
        self.assert_rfc_7946(read_json(self.folder / "map/map.geojson"))

    def test_inspect_says_that_the_table_is_complete(self):
        result = run("roadvec-inspect", self.streaming_drive(), "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn('"table_complete": true', result.stdout)
        self.assertIn('"gps": true', result.stdout)

    def test_a_capture_without_a_table_says_why_there_is_no_map(self):
        drive = self.copy_of_drive(lambda tables: tables["lidar"].update(calibration="streamed"))
        result = run("roadvecd", "--drive", drive, "--out", self.folder / "map")
        self.assertEqual(result.returncode, 1)
        self.assertRegex(result.stderr, "before the calibration that the sensor streams was complete.*db.xml")


if __name__ == "__main__":
    programs.main()
