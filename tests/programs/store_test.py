"""The map on the disk: killed at random moments, read while it is written, and what the file system may do to it.

ROADVEC_KILLS: how often the daemon is killed, 3 if not said. Tests that mount a file system run in a user namespace of their own.
"""

import contextlib
import json
import os
import random
import shutil
import sqlite3
import subprocess
import sys
import time

import programs
from live import LiveDaemonTest
from programs import DRIVE, counters_of, run, running

KILLS = int(os.environ.get("ROADVEC_KILLS", "3"))
IN_NAMESPACE = "ROADVEC_IN_NAMESPACE"


def shell(*arguments):
    return subprocess.run([str(argument) for argument in arguments], capture_output=True, text=True, timeout=60, check=True).stdout


def stage_of(status, name):
    return next(stage for stage in status["stages"] if stage["name"] == name)


class StoreTest(LiveDaemonTest):
    def setUp(self):
        super().setUp()
        self.file = self.map / "map.gpkg"
        self.tables["storage"] = {"directory": str(self.map), "batch_s": 0.05, "resume": False}

    def daemon(self, *arguments):
        """As the service starts it: nothing but map.gpkg."""
        return running("roadvecd", "--config", self.car_file(self.tables), *arguments)

    def looped_drive(self):
        return running("roadvec-replay", DRIVE, "--udp", f"127.0.0.1:{self.tables['lidar']['port']}", "--position-port", 0,
                       "--can-pipe", self.fifo, "--loop")

    @contextlib.contextmanager
    def mapping_daemon(self):
        with self.daemon() as daemon, self.looped_drive() as drive:
            self.wait_until_it_serves(daemon)
            yield daemon, drive

    def rows(self, file, query):
        with contextlib.closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as database:
            return database.execute(query).fetchall()

    def wait_until_durable(self, beyond=0):
        def durable():
            status = self.status()
            return status if status["durable_seq"] > beyond and stage_of(status, "store")["state"] == "ok" else None

        return self.wait_until("something on the disk", durable, 40)

    def wait_until_degraded(self, words, state):
        def degraded():
            status = self.status()
            return status if words in stage_of(status, "store")["detail"] and status["state"] == "degraded" else None

        status = self.wait_until(words, degraded, 40)
        self.assertEqual(stage_of(status, "store")["state"], state)
        return status

    # --- killed -----------------------------------------------------------------------------------------------------------

    def test_nothing_acknowledged_is_lost_when_it_is_killed_at_random_moments(self):
        seed = int.from_bytes(os.urandom(4), "little")
        moments = random.Random(seed)
        kept, acknowledged_count = [], 0
        with self.looped_drive():
            for kill in range(KILLS):
                with self.daemon() as daemon:
                    self.wait_until_it_serves(daemon)
                    if kill == KILLS - 1:
                        self.wait_until_durable()
                    acknowledged = self.acknowledged_until(time.monotonic() + moments.uniform(0.1, 6))
                    daemon.kill()
                    daemon.wait()
                kept = self.check_after_kill(kept, acknowledged, f"kill {kill} of seed {seed}")
                acknowledged_count += acknowledged > 0
        print(f"{KILLS} kills, {acknowledged_count} of them with changes acknowledged; {len(kept)} parts of {self.file.stat().st_size} bytes")
        self.assertGreater(acknowledged_count, 0)

    def acknowledged_until(self, end):
        """The newest change that the daemon has called durable."""
        acknowledged = 0
        while time.monotonic() < end:
            acknowledged = max(acknowledged, self.status()["durable_seq"])
        return acknowledged

    def check_after_kill(self, kept, acknowledged, message):
        """On a copy, so that the next start finds file and log as the kill has left them."""
        copy = self.folder / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(self.map, copy)
        file = copy / "map.gpkg"
        self.assertEqual([path.name for path in self.map.iterdir() if "damaged" in path.name], [], message)
        if not file.exists():
            self.assertEqual((acknowledged, kept), (0, []), message)
            return kept
        self.assertEqual(self.rows(file, "PRAGMA integrity_check"), [("ok",)], message)
        if not self.rows(file, "SELECT name FROM sqlite_master WHERE name = 'parts'"):
            self.assertEqual((acknowledged, kept), (0, []), message)
            return kept
        parts = self.rows(file, "SELECT part, seq, finished, (SELECT count(*) FROM boundaries b WHERE b.part = p.part) "
                                "FROM parts p ORDER BY part")
        self.assertEqual(parts[:len(kept)], kept, message)
        self.assertLessEqual(len(parts), len(kept) + 1, message)
        if acknowledged:
            self.assertEqual(len(parts), len(kept) + 1, message)
            self.assertGreaterEqual(parts[-1][1], acknowledged, message)
        return parts

    # --- read -------------------------------------------------------------------------------------------------------------

    def test_gis_programs_read_it_while_it_is_written(self):
        with self.mapping_daemon() as (daemon, _):
            acknowledged = 0
            for _ in range(3):
                acknowledged = self.wait_until_durable(acknowledged)["durable_seq"]
                summary = shell("ogrinfo", "-ro", "-so", self.file, "boundaries")
                self.assertIn("Geometry: 3D Line String", summary)
                lines = json.loads(shell("ogr2ogr", "-f", "GeoJSON", "/vsistdout/", self.file, "boundaries"))["features"]
                self.assertGreater(len(lines), 0)
                (part,) = json.loads(shell("ogr2ogr", "-f", "GeoJSON", "/vsistdout/", self.file, "parts"))["features"]
                self.assertGreaterEqual(part["properties"]["seq"], acknowledged)
            self.assertEqual(shell("ogrinfo", "-ro", self.file).split("\n")[2:4],
                             ["1: boundaries (3D Line String)", "2: parts (None)"])
            self.stop(daemon)
        valid = shell(sys.executable, "-m", "osgeo_utils.samples.validate_gpkg", self.file)
        self.assertNotRegex(valid, "(?i)error|warning")
        self.assertEqual([path.name for path in self.map.iterdir()], ["map.gpkg"])
        self.assertEqual(self.rows(self.file, "SELECT finished FROM parts"), [(1,)])
        self.check_exports()

    def check_exports(self):
        """Every format from the stored file, read back by programs that others wrote."""
        lines = self.rows(self.file, "SELECT line_id, kind FROM boundaries ORDER BY line_id")
        exported = {name: self.folder / f"exported.{name}" for name in ("gpkg", "geojson", "osm")}
        for form, path in zip(("gpkg", "geojson", "lanelet2"), exported.values()):
            result = run("roadvec", "export", form, "--map", self.file, "-o", path)
            self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(self.rows(exported["gpkg"], "SELECT line_id, kind FROM boundaries ORDER BY line_id"), lines)
        valid = shell(sys.executable, "-m", "osgeo_utils.samples.validate_gpkg", exported["gpkg"])
        self.assertNotRegex(valid, "(?i)error|warning")
        for layer, path in (("boundaries", exported["gpkg"]), ("exported", exported["geojson"])):
            self.assertIn(f"Feature Count: {len(lines)}\n", shell("ogrinfo", "-ro", "-so", path, layer))
        self.assert_rfc_7946(json.loads(exported["geojson"].read_text(encoding="utf-8")))
        info = json.loads(shell("osmium", "fileinfo", "--extended", "--json", exported["osm"]))
        self.assertEqual(info["data"]["count"]["ways"], len(lines))
        self.assertGreater(info["data"]["count"]["nodes"], 2 * len(lines))
        shell("osmium", "check-refs", exported["osm"])
        ways = json.loads(shell("osmium", "export", "--geometry-types=linestring", "-f", "geojson", exported["osm"]))["features"]
        types = sorted(feature["properties"]["type"] for feature in ways)
        self.assertEqual(types, sorted("curbstone" if kind == "curb" else "road_border" for _, kind in lines))

    def test_a_locked_file_is_waited_for(self):
        with self.mapping_daemon() as (daemon, _):
            before = self.wait_until_durable()["durable_seq"]
            with contextlib.closing(sqlite3.connect(self.file, isolation_level=None)) as other:
                other.execute("BEGIN IMMEDIATE")
                locked = self.wait_until_degraded("locked by another program", "locked")
                self.assertGreater(locked["head_seq"], before)
            self.wait_until_durable(locked["head_seq"])
            self.stop(daemon)

    def test_a_file_that_is_moved_away_is_written_anew(self):
        with self.mapping_daemon() as (daemon, _):
            self.wait_until_durable()
            self.file.rename(self.folder / "moved.gpkg")
            self.wait_until("the file", self.file.exists)
            head_seq = self.status()["head_seq"]
            self.wait_until_durable(head_seq)
            self.stop(daemon)
        self.assertEqual(len(self.rows(self.file, "SELECT part FROM parts")), 1)

    def test_a_damaged_file_is_set_aside_and_named(self):
        self.map.mkdir()
        self.file.write_bytes(b"not a map" * 1000)
        with self.mapping_daemon() as (daemon, _):
            self.wait_until("a new file", lambda: self.status()["durable_seq"] > 0, 40)
            status = self.status()
            aside = [path for path in self.map.iterdir() if path.name.startswith("map-damaged-")]
            self.assertEqual(len(aside), 1)
            self.assertIn(aside[0].name, stage_of(status, "store")["detail"])
            self.assertEqual(counters_of(status, "store")["set_aside"], 1)
            self.assertIn(aside[0].name, self.stop(daemon))
        self.assertEqual(aside[0].read_bytes(), b"not a map" * 1000)

    def test_a_daemon_that_could_never_write_maps_and_says_at_its_end_what_is_missing(self):
        self.map.write_text("a file in the way", encoding="utf-8")
        with self.mapping_daemon() as (daemon, _):
            self.wait_until_degraded("cannot be written", "unwritable")
            self.wait_until("a map", lambda: self.status()["line_count"] > 0)
            daemon.terminate()
            _, log = daemon.communicate(timeout=30)
        self.assertEqual(daemon.returncode, 1, log)
        self.assertIn("the end of the map is not on the disk", log)

    # --- file systems -----------------------------------------------------------------------------------------------------

    def mount(self, options):
        if os.environ.get(IN_NAMESPACE) != "yes":
            print("skipped: no user namespaces here")
            return False
        self.map.mkdir(exist_ok=True)
        shell("mount", "-t", "tmpfs", "-o", options, "tmpfs", self.map)
        self.addCleanup(subprocess.run, ["umount", "-l", str(self.map)], check=False)
        return True

    def test_a_full_disk_is_waited_for(self):
        if not self.mount("size=2M"):
            return
        with self.mapping_daemon() as (daemon, _):
            self.wait_until_durable()
            ballast = self.map / "ballast"
            with open(ballast, "wb", buffering=0) as file, contextlib.suppress(OSError):
                while True:
                    file.write(bytes(4096))
            full = self.wait_until_degraded("disk full", "full")
            saved = run("roadvec", "control", "save", "--control-socket", self.folder / "control.sock", timeout_s=30)
            self.assert_refused(saved, 1, "disk full: make room")
            self.assertEqual(self.rows(self.file, "PRAGMA integrity_check"), [("ok",)])
            ballast.unlink()
            self.wait_until_durable(full["head_seq"])
            self.stop(daemon)
        self.assertEqual(self.rows(self.file, "PRAGMA integrity_check"), [("ok",)])

    def test_a_directory_that_may_only_be_read_is_waited_for(self):
        if not self.mount("size=8M,ro"):
            return
        with self.mapping_daemon() as (daemon, _):
            waiting = self.wait_until_degraded("cannot be written", "unwritable")
            self.wait_until("a growing map", lambda: self.status()["head_seq"] > waiting["head_seq"])
            shell("mount", "-o", "remount,rw", self.map)
            self.wait_until_durable(self.status()["head_seq"])
            self.stop(daemon)


if __name__ == "__main__":
    if IN_NAMESPACE not in os.environ:
        possible = subprocess.run(["unshare", "--user", "--map-root-user", "--mount", "true"], check=False).returncode == 0
        os.environ[IN_NAMESPACE] = "yes" if possible else "no"
        if possible:
            os.execvp("unshare", ["unshare", "--user", "--map-root-user", "--mount", sys.executable, "-B", *sys.argv])
    programs.main()
