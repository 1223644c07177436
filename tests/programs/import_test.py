"""roadvec-import on a real recording, KITTI 0005, where it is there, and on what is none."""

import bisect
import json
import math
import tarfile

import programs
from programs import RECORDINGS, ProgramTest, counters_of, read_json, run

RAW = RECORDINGS / "kitti_0005_raw_40_sweeps.tar.xz"
DRIVE = RECORDINGS / "kitti_0005_drive.tar.xz"


class Path:
    """A TUM file as positions and headings in time."""

    def __init__(self, text):
        self.rows = [tuple(map(float, line.split())) for line in text.splitlines()]
        self.times = [row[0] for row in self.rows]

    def at(self, time_s):
        i = min(max(bisect.bisect(self.times, time_s), 1), len(self.rows) - 1)
        (ta, *a), (tb, *b) = self.rows[i - 1], self.rows[i]
        share = (time_s - ta) / (tb - ta)
        yaw_a, yaw_b = (math.atan2(2 * (q[6] * q[5] + q[3] * q[4]), 1 - 2 * (q[4] ** 2 + q[5] ** 2)) for q in (a, b))
        return [p + share * (q - p) for p, q in zip(a[:2], b[:2])], yaw_a + share * math.remainder(yaw_b - yaw_a, math.tau)

    def step(self, from_s, to_s):
        """How far it is from one time to the other as the crow flies, and the turn."""
        (p, p_yaw), (q, q_yaw) = self.at(from_s), self.at(to_s)
        return math.dist(p, q), math.remainder(q_yaw - p_yaw, math.tau)


class ImportTest(ProgramTest):
    def test_a_street_in_karlsruhe_is_imported_and_mapped(self):
        if not RAW.exists() or not DRIVE.exists():
            print("skipped: no recordings")
            return
        with tarfile.open(RAW) as archive:
            archive.extractall(self.folder)
        source = next(self.folder.glob("**/*_sync"))
        drive = self.folder / "drive"
        result = run("roadvec-import", "kitti-raw", source, drive, "--json", timeout_s=300)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stderr, "")
        report = json.loads(result.stdout)
        print(report)
        self.assertEqual(report["sweeps"], 40)
        self.assertLess(report["round_trip"]["median_m"], 0.001)
        self.assertLess(report["round_trip"]["quantile95_m"], 0.002)
        self.assertEqual(report["round_trip"]["missing"], 0)
        self.assertLess(report["round_trip"]["without_echo"], report["round_trip"]["points"] * 1e-5)
        self.assertEqual(report["left_out"], [{"first": "0000000040", "last": "0000000153", "count": 114,
                                               "reason": "there is no such scan"}])
        self.check_path(Path((drive / "truth/poses.tum").read_text(encoding="utf-8")))

        result = run("roadvecd", "--drive", drive, "--out", self.folder / "map")
        self.assertEqual(result.returncode, 0, result.stderr)
        lidar = counters_of(read_json(self.folder / "map/report.json"), "lidar")
        self.assertIn(lidar["sweeps"], (40, 41))  # the last firings may lie past the cut
        for name in ("wrong_length", "wrong_flags", "kernel_drops", "device_time_gaps", "ring_full", "reordered"):
            self.assertEqual(lidar[name], 0, name)
        self.assertGreater(len(read_json(self.folder / "map/map.geojson")["features"]), 0)
        trajectory = self.score(drive, self.folder / "map")["trajectory"]
        print(trajectory)
        self.assertLessEqual(trajectory["aligned"]["rms_m"], 0.1)

    def check_path(self, ours):
        """Against another registration of the same scans, every metre: chords and turns do not depend on where either
        has put its map, nor on how it thinks that the LiDAR is turned in the car."""
        with tarfile.open(DRIVE) as archive:
            member = next(name for name in archive.getnames() if name.endswith("truth/poses.tum"))
            reference = Path(archive.extractfile(member).read().decode())
        # The other one's first sweep stands where a constant speed has put it.
        first_s, last_s = ours.times[0] + 0.2, ours.times[-1] - 0.1
        for tick in range(int((last_s - first_s - 1.0) / 0.1)):
            time_s = first_s + 0.1 * tick
            (chord_m, turn_rad), (their_chord_m, their_turn_rad) = (path.step(time_s, time_s + 1.0) for path in (ours, reference))
            self.assertAlmostEqual(chord_m, their_chord_m, delta=0.03)
            self.assertAlmostEqual(math.degrees(turn_rad), math.degrees(their_turn_rad), delta=0.15)

    def test_a_folder_that_is_no_drive_is_refused(self):
        result = run("roadvec-import", "kitti-raw", self.folder, self.folder / "drive")
        self.assert_refused(result, 1, "^roadvec-import: ", "has no folder oxts", "_sync")

    def test_wrong_use_is_told_from_failure(self):
        for arguments in ([], ["kitti-raw"], ["kitti-raw", self.folder], ["nuscenes", self.folder, "x"]):
            result = run("roadvec-import", *arguments)
            self.assertEqual(result.returncode, 2, arguments)
        for arguments in (["--help"], ["kitti-raw", "--help"], ["--version"]):
            result = run("roadvec-import", *arguments)
            self.assertEqual(result.returncode, 0, arguments)
            self.assertIn("roadvec-import", result.stdout)


if __name__ == "__main__":
    programs.main()
