"""roadvec-score --paper-tables. The street of the other tests stands for each of its drives: the shipped ones take minutes."""

import json

import programs
from programs import DRIVE, ProgramTest, run

SCENES = ("scene_a", "scene_b", "scene_c", "paper_loop")
FIGURES = ("mean_m", "relative_percent", "along_mean_m", "across_mean_m", "heading_mean_deg", "unobserved_percent",
           "time_mean_ms", "time_p50_ms")


class TablesTest(ProgramTest):
    def setUp(self):
        super().setUp()
        for scene in SCENES:
            (self.folder / scene).symlink_to(DRIVE)

    def run_tables(self, *arguments):
        return run("roadvec-score", "--paper-tables", "--drives", self.folder, "--seeds", 1, *arguments)

    def test_every_figure_is_there_beside_the_papers_and_sane(self):
        result = self.run_tables("--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        tables = json.loads(result.stdout)
        self.assertEqual([scene["scene"] for scene in tables["scenes"]], ["Scene A", "Scene B", "Scene C"])
        for scene in tables["scenes"]:
            self.assertEqual(scene["pairs"], 8)
            self.assertAlmostEqual(scene["distance_mean_m"], 0.8, delta=0.2)
            self.assertLess(scene["paper"]["lvm"]["mean_m"], scene["paper"]["icp"]["mean_m"])
            with_pcl = ("icp",) if scene["methods"]["icp"] else ()  # null where it was built without PCL
            for method in (*with_pcl, "sweep", "raw_lvm", "lvm"):
                for figure in FIGURES:
                    self.assertGreaterEqual(scene["methods"][method][figure], 0, (method, figure))
            lvm = scene["methods"]["lvm"]
            self.assertLess(scene["methods"]["sweep"]["mean_m"], 0.02)
            self.assertLess(lvm["across_mean_m"], 0.02)
            # Where the matcher says that it cannot see along the road, the start's error stays: 0.38 m on average.
            self.assertLess(lvm["mean_m"], 0.05 + 0.38 * lvm["unobserved_percent"] / 100)
            self.assertLess(scene["methods"]["lvm"]["heading_mean_deg"], 0.3)  # the starts: 1.5 degrees
            self.assertLess(0, scene["left_of_hits_percent"])
            self.assertLess(scene["left_of_hits_percent"], scene["left_of_cells_percent"])
        self.check_loop(tables["loop"])

    def check_loop(self, loop):
        """The score tool runs the pipeline itself; roadvecd must come to the same path."""
        out = self.folder / "map"
        self.assertEqual(run("roadvecd", "--drive", DRIVE, "--out", out).returncode, 0)
        figures = self.score(DRIVE, out)
        for figure, of_paper in (("mean_m", 0.466), ("max_m", 1.162)):
            self.assertAlmostEqual(loop["optimised"][figure], figures["trajectory"]["from_start"][figure], delta=1e-3)
            self.assertGreater(loop["matched"][figure], 0)
            self.assertGreater(loop["odometry"][figure], 0)
            self.assertEqual(loop["paper"][figure], of_paper)
        size = figures["map"]
        self.assertGreater(size["tile_bytes"], 100)
        self.assertLess(size["tile_bytes"], size["geojson_bytes"])
        self.assertAlmostEqual(size["tile_bytes_per_km"] * figures["trajectory"]["way_m"] / 1000, size["tile_bytes"],
                               delta=0.01 * size["tile_bytes"])

    def test_the_text_has_the_papers_layout(self):
        text = self.run_tables().stdout
        for words in ("TABLE I ", "TABLE II", r"Scene A .*\( *98\.05\).*\( *3\.98\)", r"Scene C .*\( *0\.38\).*\( *9\.32\)",
                      "POINTS LEFT", "LOOP", r"0\.466 / 1\.162 m"):
            self.assertRegex(text, words)

    def test_drives_that_will_not_do_are_named(self):
        made = run("roadvec-simulate", "street", self.folder / "short", "--duration", 1)
        self.assertEqual(made.returncode, 0, made.stderr)
        (self.folder / "scene_a").unlink()
        (self.folder / "short").rename(self.folder / "scene_a")
        self.assert_refused(self.run_tables(), 1, "scene_a: too short")
        (self.folder / "scene_a/drive.toml").unlink()  # then it must be made, in a folder that is in use
        self.assert_refused(self.run_tables(), 1, "scene_a", "empty")
        nowhere = run("/usr/bin/env", "TMPDIR=/missing", programs.command("roadvec-score")[0], "--paper-tables")
        self.assert_refused(nowhere, 1, "TMPDIR", "--drives")
        self.assertEqual(run("roadvec-score", "--paper-tables", "a", "b").returncode, 2)
        self.assertEqual(run("roadvec-score", "a", "b", "--drives", "c").returncode, 2)


if __name__ == "__main__":
    programs.main()
