"""roadvecd on a real CAN bus and with a clock that may be set: a drive's CAN log played into vcan0 by canplayer, and what can
happen to a bus and a clock."""

import json
import subprocess
import time

import programs
from programs import DRIVE, ProgramTest, counters_of, read_json, run, running

HOUR_S = 3600


class VcanTest(ProgramTest):
    def setUp(self):
        super().setUp()
        self.add_bus()
        self.addCleanup(self.shell, "ip link del vcan0")

    def add_bus(self):
        self.shell("ip link add vcan0 mtu 72 type vcan && ip link set vcan0 up")

    def shell(self, command):
        subprocess.run(command, shell=True, check=True)

    def status(self):
        """Empty until the daemon answers."""
        result = run("roadvec", "--socket", self.folder / "map.sock", "status", "--json")
        return json.loads(result.stdout or "{}")

    def state(self, stage="can"):
        return next((s["state"] for s in self.status().get("stages", []) if s["name"] == stage), None)

    def count(self, name, stage="can"):
        return counters_of(self.status(), stage)[name]

    def wait_until(self, what, happened, limit_s=60):
        end = time.monotonic() + limit_s
        while time.monotonic() < end:
            if happened():
                return
            time.sleep(0.2)
        self.fail(f"{what}: not within {limit_s} s; {json.dumps(self.status(), indent=1)}")

    def wait_for(self, state, stage="can"):
        self.wait_until(f"{stage}: {state}", lambda: self.state(stage) == state)

    def recorded_samples(self):
        """What the log gives when it is read as a file; a few sweeps will do beside it."""
        drive = self.copy_of_drive(lambda tables: tables.pop("imu"))
        (drive / "lidar.pcap").unlink()
        programs.write_pcap_start(drive / "lidar.pcap", 1000)
        result = run("roadvecd", "--drive", drive, "--out", self.folder / "recorded", timeout_s=300)
        self.assertEqual(result.returncode, 0, result.stderr)
        return counters_of(read_json(self.folder / "recorded/report.json"), "vehicle")["samples"]

    def test_a_drive_on_the_bus_gives_as_many_samples_as_its_log_and_the_bus_may_fail_and_come_back(self):
        expected = self.recorded_samples()
        with running("roadvecd", "--config", self.car_file(self.car_tables(can="vcan0"))) as daemon:
            self.wait_for("waiting")
            self.shell(f"canplayer -I {DRIVE}/can.log vcan0=can0")
            self.wait_until("all samples", lambda: self.count("samples", "vehicle") >= expected)
            self.assertEqual(self.count("samples", "vehicle"), expected)
            self.assertEqual((self.count("kernel_drops"), self.count("ring_full", "vehicle")), (0, 0))
            self.wait_for("silent")
            with subprocess.Popen(["canplayer", "-l", "i", "-I", f"{DRIVE}/can.log", "vcan0=can0"]) as player:
                self.wait_for("ok")
                player.kill()
            self.the_controller_leaves_the_bus()
            self.the_interface_goes_down_and_is_removed()
            self.assertIsNone(daemon.poll())

    def the_controller_leaves_the_bus(self):
        self.shell("cansend vcan0 20000040#0000000000000000")
        self.wait_for("bus-off")
        self.assertEqual(self.count("bus_off"), 1)
        self.shell("cansend vcan0 20000100#0000000000000000")
        self.wait_for("silent")
        self.assertEqual(self.count("restarted"), 1)

    def the_interface_goes_down_and_is_removed(self):
        self.shell("ip link set vcan0 down")
        self.wait_for("down")
        self.assertEqual(self.count("interface_down"), 1)
        self.shell("ip link del vcan0")
        self.wait_for("lost")
        self.assertEqual(self.count("interface_lost"), 1)
        self.add_bus()
        self.wait_until("the interface is opened again", lambda: self.count("interface_reopened") == 1)
        with subprocess.Popen(["canplayer", "-l", "i", "-I", f"{DRIVE}/can.log", "vcan0=can0"]) as player:
            self.wait_for("ok")
            player.kill()

    def test_a_wall_clock_set_by_an_hour_moves_no_car(self):
        tables = self.car_tables(can="vcan0")
        with running("roadvecd", "--config", self.car_file(tables)) as daemon, running(
                "roadvec-replay", DRIVE, "--udp", f"127.0.0.1:{tables['lidar']['port']}", "--position-port", 0, "--can", "vcan0",
                "--speed", 0.25, "--loop"):
            self.wait_for("ok")
            self.wait_for("ok", "mapping")
            for number, step_s in enumerate((HOUR_S, -HOUR_S), 1):
                self.wait_for("ok", "clock")
                before = self.status()
                try:
                    time.clock_settime(time.CLOCK_REALTIME, time.time() + step_s)
                except PermissionError:
                    print("skipped: the clock may not be set here")
                    return
                self.wait_for("stepped", "clock")
                self.assertEqual(self.count("host_steps", "clock"), number)
                self.wait_until("sweeps", lambda: self.status()["time_s"] > before["time_s"] + 4)
                self.assert_nothing_has_moved(before, self.status(), step_s)
            self.wait_for("ok", "clock")
            self.assertIsNone(daemon.poll())

    def assert_nothing_has_moved(self, before, after, step_s):
        self.assertLess(after["time_s"] - before["time_s"], 60)
        self.assertLess(after["travelled_m"] - before["travelled_m"], 60)
        mapping = next(stage for stage in after["stages"] if stage["name"] == "mapping")
        self.assertEqual(mapping["state"], "ok", step_s)
        self.assertIn("speed from wheels", mapping["detail"], step_s)


if __name__ == "__main__":
    programs.main()
