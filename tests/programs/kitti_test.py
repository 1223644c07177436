"""roadvecd --drive on a real recording, KITTI 0005, where it is there."""

import tarfile

import programs
from programs import RECORDINGS, ProgramTest, counters_of, read_json, run

ARCHIVE = RECORDINGS / "kitti_0005_drive.tar.xz"


class KittiTest(ProgramTest):
    def test_a_street_in_karlsruhe_is_mapped_without_loss(self):
        if not ARCHIVE.exists():
            print("skipped: no recordings")
            return
        with tarfile.open(ARCHIVE) as archive:
            archive.extractall(self.folder)
        drive = next(self.folder.glob("*/drive.toml")).parent
        result = run("roadvecd", "--drive", drive, "--out", self.folder / "map")
        self.assertEqual(result.returncode, 0, result.stderr)
        lidar = counters_of(read_json(self.folder / "map/report.json"), "lidar")
        self.assertEqual(lidar["sweeps"], 153)
        for name in ("wrong_length", "wrong_flags", "kernel_drops", "device_time_gaps", "ring_full", "reordered"):
            self.assertEqual(lidar[name], 0, name)
        score = self.score(drive, self.folder / "map", "--matching", "--seeds", 1)
        trajectory, matching = score["trajectory"], score["matching"]["methods"]
        print(trajectory, matching)
        for lines in ("sweep", "raw_lvm", "lvm"):
            self.assertLessEqual(matching[lines]["median_m"], 0.03)
        self.assertLessEqual(matching["lvm"]["lost_percent"], 5)
        self.assertLessEqual(trajectory["aligned"]["rms_m"], 0.05)
        self.assertLessEqual(trajectory["rpe_percent_per_10m"], 0.5)


if __name__ == "__main__":
    programs.main()
