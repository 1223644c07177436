"""roadvecd on a real CAN bus: a drive's CAN log played into vcan0 by canplayer."""

import json
import subprocess
import time

import programs
from programs import DRIVE, ProgramTest, counters_of, read_json, run, running


class VcanTest(ProgramTest):
    def setUp(self):
        super().setUp()
        self.shell("ip link add vcan0 mtu 72 type vcan && ip link set vcan0 up")
        self.addCleanup(self.shell, "ip link del vcan0")

    def shell(self, command):
        subprocess.run(command, shell=True, check=True)

    def vehicle(self):
        """The counters of the vehicle stage and its state, once the daemon answers."""
        result = run("roadvec", "--socket", self.folder / "map.sock", "status", "--json")
        if result.returncode != 0:
            return {}, ""
        status = json.loads(result.stdout)
        return counters_of(status, "vehicle"), [s["state"] for s in status["stages"] if s["name"] == "vehicle"][0]

    def wait_until(self, what, happened, limit_s=60):
        end = time.monotonic() + limit_s
        while time.monotonic() < end:
            if happened():
                return
            time.sleep(0.2)
        self.fail(f"{what}: not within {limit_s} s; {self.vehicle()}")

    def recorded_samples(self):
        """What the log gives when it is read as a file; a few sweeps will do beside it."""
        drive = self.copy_of_drive(lambda tables: tables.pop("imu"))
        (drive / "lidar.pcap").unlink()
        programs.write_pcap_start(drive / "lidar.pcap", 1000)
        result = run("roadvecd", "--drive", drive, "--out", self.folder / "recorded", timeout_s=300)
        self.assertEqual(result.returncode, 0, result.stderr)
        return counters_of(read_json(self.folder / "recorded/report.json"), "vehicle")["samples"]

    def test_a_drive_on_the_bus_gives_as_many_samples_as_its_log(self):
        expected = self.recorded_samples()
        with running("roadvecd", "--config", self.car_file(self.car_tables(can="vcan0"))) as daemon:
            self.wait_until("the daemon", lambda: self.vehicle()[1] == "silent")
            self.shell(f"canplayer -I {DRIVE}/can.log vcan0=can0")
            self.wait_until("all samples", lambda: self.vehicle()[0]["samples"] >= expected)
            counters, _ = self.vehicle()
            self.assertEqual(counters["samples"], expected)
            self.assertEqual((counters["can_kernel_drops"], counters["ring_full"]), (0, 0))
            self.shell("cansend vcan0 20000040#0000000000000000")
            self.wait_until("bus-off", lambda: "bus-off" in self.vehicle()[1])
            self.shell("cansend vcan0 20000100#0000000000000000")
            self.wait_until("the restart", lambda: self.vehicle()[0]["can_restarted"] == 1)
            self.assertEqual(self.vehicle()[1], "receiving")
            self.shell("ip link set vcan0 down")
            self.wait_until("the interface is down", lambda: "is down" in self.vehicle()[1])
            self.assertIsNone(daemon.poll())


if __name__ == "__main__":
    programs.main()
