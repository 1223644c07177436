"""roadvecd as in the car, for tests: its configuration, its inputs, and what it answers."""

import json
import os
import signal
import socket
import time

from programs import DRIVE, ProgramTest, drive_toml, run, running


DEGRADED = 4


class LiveDaemonTest(ProgramTest):
    """A test with a roadvecd as in the car, and a drive to play into it."""

    def setUp(self):
        super().setUp()
        self.fifo, self.serial, self.socket = (self.folder / name for name in ("can.fifo", "imu", "map.sock"))
        self.map = self.folder / "map"
        os.mkfifo(self.fifo)
        self.tables = self.car_tables(can=str(self.fifo))

    def wait_until_it_serves(self, daemon):
        def answers():
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
                return probe.connect_ex(str(self.socket)) == 0

        self.wait_until("the map socket", lambda: answers() or daemon.poll() is not None)
        self.assertIsNone(daemon.poll(), "roadvecd has ended")

    def wait_until(self, what, happened, limit_s=20):
        end = time.monotonic() + limit_s
        while time.monotonic() < end:
            if answer := happened():
                return answer
            time.sleep(0.05)
        return self.fail(f"{what}: not within {limit_s} s")

    def roadvec(self, *arguments, returncode=0):
        result = run("roadvec", "--socket", self.socket, *arguments, timeout_s=30)
        self.assertEqual(result.returncode, returncode, f"{arguments}: {result.stderr}")
        return result.stdout

    def status(self):
        result = run("roadvec", "--socket", self.socket, "status", "--json", timeout_s=30)
        self.assertIn(result.returncode, (0, DEGRADED), result.stderr)
        status = json.loads(result.stdout)
        self.assertEqual(result.returncode == 0, status["state"] == "mapping")
        return status

    def connection(self):
        connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.addCleanup(connection.close)
        connection.connect(str(self.socket))
        return connection

    def stop(self, daemon):
        begin = time.monotonic()
        daemon.send_signal(signal.SIGTERM)
        _, log = daemon.communicate(timeout=30)
        self.assertEqual(daemon.returncode, 0, log)
        self.assertLess(time.monotonic() - begin, 10)
        return log

    def use_serial_line(self):
        settings = drive_toml()["imu"]
        del settings["log"]
        self.tables["imu"] = {**settings, "device": str(self.serial)}

    def replay(self, *arguments, drive=DRIVE):
        return running("roadvec-replay", drive, "--udp", f"127.0.0.1:{self.tables['lidar']['port']}", "--position-port", 0,
                       "--can-pipe", self.fifo, "--imu-pty", self.serial, "--json", *arguments)

    def daemon(self, *arguments):
        """It keeps the map in self.map, and leaves the other files there when it ends."""
        return running("roadvecd", "--config", self.car_file(self.tables), "--out", self.map, *arguments)
