"""A start of the daemon goes on with the map that an earlier one left on the disk."""

import contextlib
import itertools
import math
import pathlib
import sqlite3
import struct
import tempfile
import unittest

from live import LiveDaemonTest
from programs import run, running


def optimiser_of(status):
    return next(stage for stage in status["stages"] if stage["name"] == "optimiser")


class ResumeTest(LiveDaemonTest):
    """On twelve seconds of the street: 40 m of it must agree, and then there must be some left."""

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="roadvec-")
        cls.addClassCleanup(folder.cleanup)
        cls.street = pathlib.Path(folder.name) / "street"
        made = run("roadvec-simulate", "street", cls.street, "--duration", 12)
        assert made.returncode == 0, made.stderr

    def setUp(self):
        super().setUp()
        self.file = self.map / "map.gpkg"
        self.tables["storage"] = {"directory": str(self.map), "batch_s": 0.1}

    @contextlib.contextmanager
    def serving_daemon(self):
        with running("roadvecd", "--config", self.car_file(self.tables)) as daemon:
            self.wait_until_it_serves(daemon)
            yield daemon

    def drive(self):
        """The whole drive into the running daemon; the status at its end."""
        with running("roadvec-replay", self.street, "--udp", f"127.0.0.1:{self.tables['lidar']['port']}", "--position-port", 0,
                     "--can-pipe", self.fifo) as drive:
            self.assertEqual(drive.wait(60), 0)
        return self.wait_until("all of it on the disk", self.all_durable)

    def has_recalled(self):
        status = self.status()
        return status if "recalled_keyframes" in optimiser_of(status)["gauges"] else None

    def all_durable(self):
        status = self.status()
        return status if status["head_seq"] == status["durable_seq"] > 0 else None

    def let_go_count(self):
        with contextlib.closing(sqlite3.connect(f"file:{self.file}?mode=ro", uri=True)) as database:
            return database.execute("SELECT count(*) FROM parts WHERE let_go").fetchone()[0]

    def steps_of_part(self, part):
        """Between neighbouring keyframes: how far their poses are apart, and how far odometry says that they are."""
        with contextlib.closing(sqlite3.connect(f"file:{self.file}?mode=ro", uri=True)) as database:
            rows = database.execute("SELECT x_m, y_m, step FROM x_keyframes WHERE part = ? ORDER BY keyframe", (part,)).fetchall()
        self.assertGreater(len(rows), 10)
        return [(math.dist(a[:2], b[:2]), math.hypot(*struct.unpack_from("<2d", b[2]))) for a, b in itertools.pairwise(rows)]

    def parts(self):
        """Of each: its number, the one it continues, lines, and keyframes of its own."""
        with contextlib.closing(sqlite3.connect(f"file:{self.file}?mode=ro", uri=True)) as database:
            return database.execute(
                "SELECT part, continues, (SELECT count(*) FROM boundaries b WHERE b.part = p.part),"
                " (SELECT count(*) FROM x_keyframes k WHERE k.part = p.part) FROM parts p ORDER BY part").fetchall()

    def test_a_start_goes_on_with_the_map_of_those_before_until_its_owner_lets_it_go(self):
        with self.serving_daemon() as daemon:
            first = self.drive()
            self.stop(daemon)
        # The next start fix is 3 m and 3 degrees off.
        self.tables["anchor"]["latitude_deg"] += 3 / 111_200
        self.tables["anchor"]["yaw_deg"] += 3
        with self.serving_daemon() as daemon:
            second = self.drive()
            daemon.kill()
            self.assertIn("part 1 of", daemon.communicate()[1])
        # Of the lines the newest part has all; the keyframes stay with the drive that brought them.
        parts = self.parts()
        self.assertEqual([part[:2] for part in parts], [(1, None), (2, 1)])
        self.assertEqual([part[2] for part in parts], [0, second["line_count"]])
        self.assertEqual(optimiser_of(second)["detail"], "", second)
        self.assertEqual(optimiser_of(second)["gauges"]["recalled_keyframes"], parts[0][3])
        for apart_m, step_m in self.steps_of_part(2):
            self.assertLess(abs(apart_m - step_m), 1, "no jump where it found itself: 3 m")
        # The second pass sees a bit more of the road; a second map of it would be twice as long.
        self.assertLess(second["map_length_m"], 1.2 * first["map_length_m"])
        self.assertGreater(second["map_length_m"], 0.95 * first["map_length_m"])

        anchor = dict(self.tables["anchor"])
        self.tables["anchor"]["latitude_deg"] += 0.01
        with self.serving_daemon() as daemon:
            self.assertIn("no drive in", self.stop(daemon))
        self.tables["anchor"] = anchor
        with self.serving_daemon() as daemon:
            recalled = optimiser_of(self.wait_until("a report", self.has_recalled))
            self.assertEqual(recalled["gauges"]["recalled_keyframes"], parts[0][3] + parts[1][3])
            self.assertIn("has not found itself", recalled["detail"])
            self.roadvec("control", "new-map", "--control-socket", self.folder / "control.sock")
            self.wait_until("let go", lambda: self.let_go_count() == 2)
            self.assertIn("part 2 of", self.stop(daemon))
        with self.serving_daemon() as daemon:
            self.assertIn("no drive in", self.stop(daemon))
        self.tables["storage"]["resume"] = False
        with self.serving_daemon() as daemon:
            self.assertNotIn("no drive in", self.stop(daemon))


if __name__ == "__main__":
    unittest.main()
