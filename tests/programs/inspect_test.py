"""roadvec-inspect on a drive and on a bare capture."""

import json
import math

import programs
from programs import DRIVE, ProgramTest, drive_toml, run, write_pcap_start

HEADER = "sweep,x_m,y_m,z_m,intensity,t_ns,laser,return"
PACKETS = 700  # two revolutions of an HDL-64E


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

    def test_a_drive_is_described_in_words_and_in_json(self):
        result = run("roadvec-inspect", DRIVE)
        self.assertEqual(result.returncode, 0, result.stderr)
        for words in (drive_toml()["lidar"]["model"], "revolutions", "points", "received", "kernel_drops"):
            self.assertIn(words, result.stdout)
        report = self.report(DRIVE)
        self.assertEqual(report["model"], drive_toml()["lidar"]["model"])
        self.assertAlmostEqual(report["duration_s"], 8, delta=0.2)
        self.assertAlmostEqual(report["revolutions_per_s"], 10, delta=0.5)
        self.assertGreaterEqual(report["complete_revolutions"], 77)
        self.assertEqual(report["counters"]["wrong_flags"] + report["counters"]["wrong_length"], 0)
        self.assertFalse(report["damaged"])

    def test_the_points_of_a_capture_are_written_one_per_line(self):
        points = self.folder / "points.csv"
        report = self.report(self.pcap, *self.whose, "--points", points)
        self.assertEqual(report["counters"]["received"] + report["position_packets"], PACKETS)
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
        self.assertAlmostEqual((max(times) - min(times)) * 1e-9, report["duration_s"], delta=0.01)

    def test_points_to_standard_output_leave_the_report_to_standard_error(self):
        result = run("roadvec-inspect", self.pcap, *self.whose, "--points", "-")
        self.assertEqual(result.returncode, 0)
        self.assertTrue(result.stdout.startswith(HEADER + "\n"))
        self.assertIn("revolutions", result.stderr)

    def test_a_capture_needs_to_be_told_whose_it_is(self):
        self.assert_refused(run("roadvec-inspect", self.pcap), 1, "--model", "HDL-64E S2")

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
        self.assert_refused(result, 1, "truncated")
        self.assertTrue(json.loads(result.stdout)["damaged"])
        self.assertEqual(json.loads(result.stdout)["counters"]["received"], PACKETS)

    def test_wrong_usage_is_told_apart(self):
        self.assertEqual(run("roadvec-inspect").returncode, 2)
        self.assertEqual(run("roadvec-inspect", self.pcap, "--modle", "VLP-16").returncode, 2)


if __name__ == "__main__":
    programs.main()
