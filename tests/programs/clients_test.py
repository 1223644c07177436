"""Clients of every kind on the map socket of a daemon that maps a drive as in the car, the owner's commands, and the protocol's
golden frames as another language reads them."""

import json
import os
import random
import re
import signal
import stat
import time

import programs
import roadvec_client
import wandering_clients
from programs import DRIVE, SOURCE, ProgramTest, run, running

PROTO = SOURCE / "core/wire/roadvec.proto"
MESSAGES = roadvec_client.load_messages(PROTO)


class ClientsTest(ProgramTest):
    def setUp(self):
        super().setUp()
        self.socket, self.control_socket = self.folder / "map.sock", self.folder / "control.sock"
        self.tables = self.car_tables(can=str(self.folder / "can.fifo"))
        os.mkfifo(self.tables["vehicle"]["can"])

    def wait_until(self, what, happened, limit_s=30):
        end = time.monotonic() + limit_s
        while not happened():
            self.assertLess(time.monotonic(), end, f"{what}: not within {limit_s} s")
            time.sleep(0.05)

    def roadvec(self, *arguments, status=0):
        result = run("roadvec", "--socket", self.socket, *arguments, timeout_s=30)
        self.assertEqual(result.returncode, status, f"{arguments}: {result.stderr}")
        return result.stdout + result.stderr

    def control(self, command, status=0):
        return self.roadvec("control", command, "--control-socket", self.control_socket, status=status)

    def lines(self):
        return json.loads(run("roadvec", "--socket", self.socket, "status", "--json", timeout_s=30).stdout)["line_count"]

    def replay(self):
        return running("roadvec-replay", DRIVE, "--udp", f"127.0.0.1:{self.tables['lidar']['port']}", "--position-port", 0,
                       "--can-pipe", self.tables["vehicle"]["can"])

    def test_clients_of_every_kind_have_the_map_of_the_drive_or_were_told(self):
        seed = random.randrange(1 << 30)
        print("seed", seed)
        with self.replay(), running("roadvecd", "--config", self.car_file(self.tables)) as daemon:
            self.wait_until("the map socket", self.socket.exists)
            self.wait_until("a map", lambda: self.lines() > 2)
            print(wandering_clients.wander(str(self.socket), MESSAGES, seed, 5))
            self.check_metrics()
            self.check_commands()
            daemon.send_signal(signal.SIGTERM)
            _, log = daemon.communicate(timeout=30)
            self.assertEqual(daemon.returncode, 0, log)
        self.assertFalse(self.control_socket.exists())

    def check_metrics(self):
        text = self.roadvec("metrics")
        self.assertTrue(text.endswith("\n# EOF\n"))
        self.assertGreater(int(re.search(r"^roadvec_lidar_received_total (\d+)$", text, re.M)[1]), 1000)
        self.assertRegex(text, r'(?m)^roadvec_mapping_step_seconds\{step="segment",quantile="0.99"\} 0\.\d+$')

    def check_commands(self):
        self.assertEqual(stat.S_IMODE(self.control_socket.stat().st_mode), 0o600)
        self.assertEqual(stat.S_IMODE(self.socket.stat().st_mode), 0o660)
        follower = roadvec_client.Connection(str(self.socket), MESSAGES, 20)
        self.addCleanup(follower.socket.close)
        follower.send(hello=MESSAGES.Hello(proto_major=1))
        follower.send(subscribe=MESSAGES.Subscribe())
        copy = roadvec_client.Map()
        self.assertRegex(self.control("save"), r"on disk; changes up to [1-9]\d* are on disk")
        saved = json.loads(self.roadvec("--json", "control", "save", "--control-socket", self.control_socket))
        self.assertEqual((saved["type"], saved["text"]), ("command_result", "on disk"))
        self.assertIn("a new map has begun", self.control("new-map"))
        while True:
            kind, message = follower.receive()
            if kind in ("snapshot_begin", "tile", "snapshot_end", "epoch_change", "delta"):
                getattr(copy, kind)(message)
            if kind == "epoch_change" and message.reason == MESSAGES.EpochChange.MAP_REPLACED:
                break
        self.assertGreater(sum(map(len, copy.tiles.values())), 2)
        while kind != "delta":
            kind, message = follower.receive()
        copy.delta(message)
        self.assertEqual(sum(map(len, copy.tiles.values())), 0, "the change that follows takes every line")
        self.assertIn("control socket only", self.roadvec("control", "new-map", "--control-socket", self.socket, status=1))


class GoldenFramesTest(ProgramTest):
    def test_another_language_reads_the_frames_of_every_minor_and_writes_the_same_bytes(self):
        files = sorted((SOURCE / "tests/data/wire").glob("frames_v1.*.hex"))
        self.assertGreaterEqual(len(files), 2)
        for file in files:
            for line in file.read_text(encoding="utf-8").splitlines():
                name, frame = line.split()
                envelope = MESSAGES.Envelope.FromString(bytes.fromhex(frame)[4:])
                self.assertEqual(envelope.WhichOneof("message"), name)
                self.assertEqual(envelope.SerializeToString().hex(), frame[8:], f"{file.name}: {name}")


if __name__ == "__main__":
    programs.main()
