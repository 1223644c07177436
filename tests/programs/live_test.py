"""roadvecd as in the car: a drive played at its true rate into UDP, a FIFO and a serial line, and clients on the map socket."""

import json
import socket
import struct
import subprocess
import sys
import types

import programs
import roadvec_client
import streamed_test
from live import DEGRADED, LiveDaemonTest
from programs import DRIVE, SOURCE, counters_of, drive_toml, read_json, run, running

HALF_A_FRAME = struct.pack("<I", 1000) + b"half"
TOO_LONG = struct.pack("<I", 0xFFFFFFFF)
NO_ENVELOPE = struct.pack("<I", 16) + b"\xff" * 16


def map_length_m(map_folder):
    return read_json(map_folder / "report.json")["map_length_m"]


class LiveTest(LiveDaemonTest):
    def python_client(self, lines_file):
        client = subprocess.Popen([sys.executable, SOURCE / "tests/support/python/roadvec_client.py", "--proto",
                                   SOURCE / "core/wire/roadvec.proto", "--socket", self.socket, "--lines", lines_file])
        self.addCleanup(client.wait)
        self.addCleanup(client.kill)
        return client

    def send_rubbish(self):
        """To the sensor's port and to the map socket."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for datagram in (b"", b"short", bytes(1300), bytes(1206)):
                sender.sendto(datagram, ("127.0.0.1", self.tables["lidar"]["port"]))
        for rubbish in (HALF_A_FRAME, TOO_LONG, NO_ENVELOPE):
            self.connection().sendall(rubbish)

    def test_a_drive_played_into_the_daemon_is_mapped_served_and_kept(self):
        self.use_serial_line()
        mapped = run("roadvecd", "--drive", DRIVE, "--out", self.folder / "recorded")
        self.assertEqual(mapped.returncode, 0, mapped.stderr)
        lines_file, watched = self.folder / "lines.json", self.folder / "watched"
        with self.replay() as replay:
            self.wait_until("the serial line", self.serial.is_symlink)
            with self.daemon() as daemon:
                self.wait_until_it_serves(daemon)
                client = self.python_client(lines_file)
                self.send_rubbish()
                with open(watched, "w", encoding="utf-8") as out, running(
                        "roadvec", "--socket", self.socket, "watch", "--json", "--poses", "--status", stdout=out) as watcher:
                    played = json.loads(replay.communicate(timeout=60)[0])
                    self.check_played(played)
                    final = self.wait_until_all_is_mapped()
                    self.check_losses(final)
                    self.check_other_commands(final)
                    self.stop(daemon)
                    _, complaint = watcher.communicate(timeout=10)
                    self.assertEqual(watcher.returncode, 0, complaint)
                self.assertEqual(client.wait(timeout=30), 0)
        self.check_watched(watched.read_text(encoding="utf-8"))
        self.check_files(lines_file)

    def check_played(self, played):
        self.assertFalse(played["interrupted"])
        self.assertEqual([track["name"] for track in played["tracks"]], ["lidar", "can", "imu"])
        for track in played["tracks"]:
            self.assertGreater(track["sent_count"], 0)
            self.assertEqual(track["lost_count"], 0, track)
        self.assertAlmostEqual(played["rate"], 1, delta=0.2)  # the machine may stall

    def wait_until_all_is_mapped(self):
        """Nothing more comes: the status of two seconds is the same, but for the time."""
        seen = []

        def settled():
            status = self.status()
            seen.append((status["head_seq"], counters_of(status, "mapping")["sweeps"]))
            return status if len(seen) > 40 and seen[-1] == seen[-40] else None

        return self.wait_until("the end of the drive", settled)

    def check_losses(self, status):
        lidar, recorded = counters_of(status, "lidar"), read_json(self.folder / "recorded/report.json")
        for name in ("kernel_drops", "reordered", "foreign_source", "sweep_overflow"):
            self.assertEqual(lidar[name], 0, name)
        # On a machine that stalls, mapping falls behind and whole sweeps are refused: counted, every one, and few.
        sweeps = counters_of(recorded, "lidar")["sweeps"] - 1  # the last revolution is open as long as more may come
        # A player that stalls for longer than half a second looks like a clock that was set, which ends a sweep early.
        self.assertIn(lidar["sweeps"] + lidar["ring_full"] - sweeps, range(lidar["clock_steps"] + 1), lidar)
        self.assertLess(lidar["ring_full"], 0.2 * sweeps)
        self.assertEqual(counters_of(status, "mapping")["sweeps"], lidar["sweeps"])
        self.assertEqual(lidar["received"], counters_of(recorded, "lidar")["received"] + lidar["wrong_flags"])
        self.assertEqual((lidar["wrong_length"], lidar["wrong_flags"]), (3, 1))  # the rubbish
        self.assertEqual(counters_of(status, "vehicle")["ring_full"], 0)
        # Not all: a pseudo-terminal drops what is unread when the player goes.
        samples = counters_of(recorded, "vehicle")["samples"]
        self.assertAlmostEqual(counters_of(status, "vehicle")["samples"], samples, delta=0.05 * samples)
        server = counters_of(status, "server")
        self.assertEqual(server["closed_frame_length"], 1)
        self.assertEqual(server["closed_malformed"], 1)
        self.assertEqual(server["closed_hello_timeout"], 1)  # the half frame was no Hello
        self.assertEqual(server["clients_overrun"], 0)
        self.assertIn("no LiDAR packets on the port for", status["not_growing_reason"])

    def check_other_commands(self, status):
        tiles = [json.loads(line) for line in self.roadvec("tiles", "--json").splitlines()]
        self.assertEqual(len(tiles), status["tile_count"])
        lines = {piece["line_id"] for tile in tiles for piece in tile["pieces"]}
        self.assertEqual(len(lines), status["line_count"])
        self.assertLess(len(self.roadvec("tiles", "--around", "1").splitlines()), len(tiles) + 1)
        screen = self.roadvec("status", returncode=DEGRADED).splitlines()
        self.assertIn("waiting; the map does not grow", screen[0])
        self.assertLessEqual(len(screen), 24)
        self.assertLessEqual(max(map(len, screen)), 80)
        exported = json.loads(self.roadvec("export", "geojson"))
        self.assert_rfc_7946(exported)
        picture = self.folder / "map.svg"
        self.roadvec("render", "-o", picture)
        self.assertIn("<svg", picture.read_text(encoding="utf-8"))
        first = [json.loads(line) for line in self.roadvec("watch", "--json", "--status", "-n", "2").splitlines()]
        self.assertEqual({message["type"] for message in first}, {"snapshot", "status"})

    def check_watched(self, text):
        messages = [json.loads(line) for line in text.splitlines()]
        kinds = [message["type"] for message in messages]
        self.assertEqual(kinds[0], "snapshot")
        self.assertNotIn("overrun", kinds)
        changes = [message["seq"] for message in messages if message["type"] in ("delta", "epoch_change")]
        self.assertGreater(len(changes), 5)
        self.assertEqual(changes, list(range(changes[0], changes[0] + len(changes))))
        self.assertGreater(kinds.count("pose"), 60)
        self.assertGreater(kinds.count("status"), 5)

    def check_files(self, lines_file):
        """The written map is what the client followed, and that of the recorded drive but for what live timing changes."""
        self.assert_rfc_7946(read_json(self.map / "map.geojson"))
        lines = {int(line_id): line for line_id, line in read_json(lines_file).items()}
        roadvec_client.compare(lines, self.map / "map.geojson", types.SimpleNamespace(**drive_toml()["anchor"]))
        live_m, recorded_m = map_length_m(self.map), map_length_m(self.folder / "recorded")
        print(f"live {live_m:.1f} m, recorded {recorded_m:.1f} m")
        self.assertAlmostEqual(live_m, recorded_m, delta=0.1 * recorded_m)
        self.assertFalse(self.socket.exists())

    def test_a_daemon_that_is_stopped_in_the_middle_of_a_drive_keeps_what_it_has(self):
        self.use_serial_line()
        with self.replay() as replay:
            self.wait_until("the serial line", self.serial.is_symlink)
            with self.daemon() as daemon:
                self.wait_until_it_serves(daemon)
                self.wait_until("a map", lambda: self.status()["line_count"] > 2)
                self.assertIn("map written to", self.stop(daemon))
                self.assertIsNone(replay.poll())
        self.assert_rfc_7946(read_json(self.map / "map.geojson"))

    def test_the_calibration_of_a_live_head_is_read_from_its_packets(self):
        """Here the readings of one round are lost with one packet in 101; a map begins when two rounds agree."""
        drive = self.copy_of_drive(lambda tables: tables["lidar"].update(calibration="streamed"))
        (drive / "lidar.pcap").unlink()
        streamed_test.write_streaming_pcap(drive / "lidar.pcap", lost_every=101)
        self.use_serial_line()
        self.tables["lidar"]["calibration"] = "streamed"
        with self.replay(drive=drive) as replay:
            self.wait_until("the serial line", self.serial.is_symlink)
            with self.daemon() as daemon:
                self.wait_until_it_serves(daemon)
                waiting = self.wait_until("packets", lambda: (s := self.status()) and counters_of(s, "lidar")["received"] and s)
                self.assertIn("calibration that the sensor streams", waiting["not_growing_reason"])
                self.wait_until("a map", lambda: self.status()["line_count"] > 2)
                put_off = counters_of(self.status(), "lidar")["uncalibrated"]
                self.assertTrue(2 * 4160 <= put_off <= 4 * 4160, put_off)
                self.stop(daemon)
                self.assertIsNone(replay.poll())

    def test_a_daemon_without_any_input_says_so_and_stops_when_asked(self):
        with self.daemon() as daemon:
            self.wait_until_it_serves(daemon)
            status = self.status()
            self.assertEqual(status["state"], "waiting")
            self.assertIn("no LiDAR packets", status["not_growing_reason"])
            self.stop(daemon)
        self.assertEqual(read_json(self.map / "map.geojson")["features"], [])

    def test_a_second_daemon_is_refused(self):
        with self.daemon() as daemon:
            self.wait_until_it_serves(daemon)
            self.tables["lidar"]["port"] = programs.free_udp_port()
            second = run("roadvecd", "--config", self.car_file(self.tables), timeout_s=20)
            self.assert_refused(second, 1, "map.sock", "in use")
            self.assertEqual(self.status()["state"], "waiting")
            self.stop(daemon)


if __name__ == "__main__":
    programs.main()
