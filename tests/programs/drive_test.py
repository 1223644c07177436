"""roadvecd --drive: what it writes, how good it is, and that it is the same every time."""

import contextlib
import os
import subprocess
import sys

import programs
from programs import DRIVE, ProgramTest, counters_of, read_json, run

STEPS = {"lidar": ["decode"],
         "mapping": ["odometry", "segment", "virtual_scan", "fuse", "vectorise", "simplify", "match"],
         "optimiser": ["close_loop", "concatenate"]}


@contextlib.contextmanager
def machine_under_load():
    """Two busy processes per processor."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2 * os.cpu_count())]
    try:
        yield
    finally:
        for process in busy:
            process.kill()
            process.wait()


class DriveTest(ProgramTest):
    def map_drive(self, name):
        out = self.folder / name
        result = run("roadvecd", "--drive", DRIVE, "--out", out)
        self.assertEqual(result.returncode, 0, result.stderr)
        return out

    def test_it_writes_a_map_a_picture_a_path_and_a_report(self):
        out = self.map_drive("out")
        self.assertEqual({path.name for path in out.iterdir()}, {"map.geojson", "map.svg", "trajectory.tum", "report.json"})
        self.assert_rfc_7946(read_json(out / "map.geojson"))
        self.assertIn("<svg", (out / "map.svg").read_text(encoding="utf-8"))

    def test_the_path_and_the_boundaries_lie_on_the_true_ones(self):
        figures = self.score(DRIVE, self.map_drive("out"), "--plot", self.folder / "errors.svg")
        trajectory, boundaries = figures["trajectory"], figures["boundaries"]
        print(trajectory, {name: value for name, value in boundaries.items() if name != "kinds"})
        self.assertGreater(trajectory["way_m"], 30)
        self.assertLessEqual(trajectory["aligned"]["rms_m"], 0.10)
        self.assertLessEqual(boundaries["lateral_median_m"], 0.10)
        self.assertGreaterEqual(boundaries["kinds"]["all"]["precision"][-1], 0.95)
        self.assertGreaterEqual(boundaries["kinds"]["all"]["recall"][-1], 0.6)
        self.assertIn("<svg", (self.folder / "errors.svg").read_text(encoding="utf-8"))

    def test_the_report_says_what_came_what_was_lost_and_how_long_it_took(self):
        report = read_json(self.map_drive("out") / "report.json")
        lidar, mapping = counters_of(report, "lidar"), counters_of(report, "mapping")
        self.assertGreater(lidar["received"], 0)
        self.assertGreaterEqual(lidar["sweeps"], 70)
        self.assertEqual(mapping["sweeps"], lidar["sweeps"])
        for name in ("wrong_length", "wrong_flags", "kernel_drops", "ring_full", "clock_steps", "sweep_overflow"):
            self.assertEqual(lidar[name], 0, name)
        self.assertEqual(counters_of(report, "vehicle")["ring_full"], 0)
        for stage, steps in STEPS.items():
            for step in steps:
                time = report["stages"][stage]["steps"][step]
                self.assertGreater(time["count"], 0, step)
                self.assertLessEqual(0, time["p50_us"], step)
                self.assertLessEqual(time["p50_us"], time["p99_us"], step)
                self.assertLessEqual(time["p99_us"], time["max_us"], step)
        self.assertGreater(report["keyframes"], 10)
        self.assertGreaterEqual(report["loops"], 0)
        self.assertGreater(report["travelled_m"], 10)
        self.assertGreater(report["map_length_m"], report["travelled_m"])  # the street has two sides

    def test_the_same_drive_gives_the_same_bytes_also_under_load(self):
        first, second = self.map_drive("first"), self.map_drive("second")
        with machine_under_load():
            loaded = self.map_drive("loaded")
        for name in ("map.geojson", "trajectory.tum", "map.svg"):
            for other in (second, loaded):
                self.assertEqual((first / name).read_bytes(), (other / name).read_bytes(), f"{other.name}/{name}")


if __name__ == "__main__":
    programs.main()
