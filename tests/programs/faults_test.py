"""Faults in the field: each is made on a running roadvecd, ends in a state that `roadvec status` names and in a counter, and is
over, without a restart, when its cause is. Those that take a real bus or set the clock: tests/vm/can_test.py; of the disk: store_test.
"""

import contextlib
import ctypes
import os
import pathlib
import random
import signal
import socket
import threading
import time

import programs
import wires
from live import LiveDaemonTest
from programs import DRIVE, running

PTRACE_SEIZE, PTRACE_INTERRUPT, PTRACE_DETACH = 0x4206, 0x4207, 17


class FaultsTest(LiveDaemonTest):
    def setUp(self):
        super().setUp()
        self.use_serial_line()
        self.fifo.unlink()
        self.lidar = wires.UdpWire(self.tables["lidar"]["port"])
        self.can = wires.LineWire(self.folder / "played.fifo", self.fifo)
        self.imu = wires.SerialWire(self.folder / "played.imu", self.serial)
        self.random = random.Random(1)
        self.car = contextlib.ExitStack()
        self.addCleanup(self.car.close)

    def start(self):
        """The daemon, healthy."""
        daemon = self.car.enter_context(running("roadvecd", "--config", self.car_file(self.tables)))
        self.car.enter_context(running("roadvec-replay", DRIVE, "--udp", f"127.0.0.1:{self.lidar.port}", "--position-port", 0,
                                       "--can-pipe", self.folder / "played.fifo", "--imu-pty", self.folder / "played.imu", "--loop"))
        self.wait_until("the player", (self.folder / "played.imu").is_symlink)
        for wire in (self.lidar, self.can):
            wire.start()
        self.imu.begin()
        for wire in (self.lidar, self.can, self.imu):
            self.car.callback(wire.close)
        self.wait_until_it_serves(daemon)
        self.wait_for(lidar="ok", can="ok", imu="ok", mapping="ok", optimiser="ok")
        return daemon

    def stages(self):
        self.last = self.status()
        return {stage["name"]: stage for stage in self.last["stages"]}

    def wait_for(self, limit_s=30, **states):
        """Until each of the named stages is in its state, all at once; gives all stages."""
        def there():
            stages = self.stages()
            found.update({name: (stages[name]["state"], stages[name]["detail"]) for name in states})
            return stages if all(found[name][0] == state for name, state in states.items()) else None

        found = {}
        end = time.monotonic() + limit_s
        while (stages := there()) is None:
            self.assertLess(time.monotonic(), end, f"{states} wanted; {found}")
            time.sleep(0.1)
        return stages

    def count(self, stages, stage, name):
        return stages[stage]["counters"][name]

    # --- sensors ----------------------------------------------------------------------------------------------------------

    def test_what_happens_to_packets_frames_and_bytes_on_their_way(self):
        daemon = self.start()
        self.losing_a_fifth_with_a_silent_bus_and_a_garbled_imu()
        self.doubled_and_reordered_packets_while_the_file_read_again_is_wrong(daemon)
        self.noise_on_the_port_a_sensor_clock_that_jumps_and_an_imu_unplugged()
        self.unplugged_lidar()
        self.assertIsNone(daemon.poll())

    def losing_a_fifth_with_a_silent_bus_and_a_garbled_imu(self):
        self.lidar.fault = lambda packet: [] if self.random.random() < 0.2 else [packet]
        self.can.fault = lambda line: []
        self.imu.fault = lambda data: [self.random.randbytes(len(data))]
        stages = self.wait_for(lidar="losing", can="silent", imu="unreadable")
        self.assertEqual(self.last["state"], "degraded")
        self.assertGreater(self.count(stages, "lidar", "dropped"), 100)
        self.assertGreater(self.count(stages, "imu", "skipped_bytes"), 100)
        self.assertGreater(stages["can"]["gauges"]["age_s"], 1)
        stages = self.wait_for(mapping="ok")
        self.assertIn("speed from matching", stages["mapping"]["detail"])
        # Once the three seconds that it tells of hold no sound packets.
        self.wait_until("a fifth of the packets", lambda: 15 < float(self.stages()["lidar"]["detail"].split()[0]) < 25)
        self.lidar.fault = self.can.fault = self.imu.fault = None
        self.assertIn("speed from wheels, yaw from imu", self.wait_for(lidar="ok", can="ok", imu="ok")["mapping"]["detail"])

    def doubled_and_reordered_packets_while_the_file_read_again_is_wrong(self, daemon):
        held = []

        def disturbed(packet):
            chance = self.random.random()
            if held:
                return [packet, held.pop()]
            if chance < 0.1:
                held.append(packet)
                return []
            return [packet, packet] if chance < 0.2 else [packet]

        before = self.count(self.stages(), "lidar", "reordered")
        self.lidar.fault = disturbed
        good = (self.folder / "car.toml").read_text(encoding="utf-8")
        (self.folder / "car.toml").write_text(good.replace("[lidar]", "[lidra]"), encoding="utf-8")
        daemon.send_signal(signal.SIGHUP)
        stages = self.wait_for(lidar="disordered", process="misconfigured")
        self.assertGreater(self.count(stages, "lidar", "reordered"), before + 50)
        self.assertIn("lidra", stages["process"]["detail"])
        self.assertEqual(self.count(stages, "process", "bad_reloads"), 1)
        self.lidar.fault = None
        (self.folder / "car.toml").write_text(good, encoding="utf-8")
        daemon.send_signal(signal.SIGHUP)
        self.wait_for(lidar="ok", process="ok")

    def noise_on_the_port_a_sensor_clock_that_jumps_and_an_imu_unplugged(self):
        steps = self.count(self.stages(), "clock", "clock_steps")
        self.imu.unplug()
        self.lidar.extra_us += 10_000_000
        self.lidar.fault = lambda packet: [packet] + [b"noise"] * 3
        stages = self.wait_for(lidar="flooded", clock="stepped", imu="lost")
        self.assertEqual(self.count(stages, "clock", "clock_steps"), steps + 1)
        self.assertRegex(stages["clock"]["detail"], r"stepped (9\.9|10\.0)\d\d s ahead")
        self.assertEqual(self.count(stages, "imu", "device_lost"), 1)
        self.assertGreater(self.count(stages, "lidar", "wrong_length"), 1000)
        self.imu.plug()
        self.lidar.fault = None
        stages = self.wait_for(lidar="ok", clock="ok", imu="ok")
        self.assertEqual(self.count(stages, "imu", "device_reopened"), 1)

    def unplugged_lidar(self):
        self.lidar.fault = lambda packet: []
        stages = self.wait_for(lidar="silent", mapping="waiting")
        self.assertEqual(self.last["state"], "waiting")
        self.assertIn("no LiDAR packets on the port for", self.last["not_growing_reason"])
        mapped = self.count(stages, "mapping", "sweeps")
        self.lidar.fault = None
        stages = self.wait_for(lidar="ok", mapping="ok")
        self.assertGreater(self.count(stages, "mapping", "sweeps"), mapped)
        self.assertEqual(self.last["not_growing_reason"], "")

    # --- threads, clients, the process ------------------------------------------------------------------------------------

    def test_another_sensor_a_starved_optimiser_a_storm_of_clients_and_a_stopped_process(self):
        daemon = self.start()
        self.another_sensor_and_a_starved_optimiser(daemon)
        self.storm_of_clients()
        self.stopped_process(daemon)
        self.assertIsNone(daemon.poll())

    def another_sensor_and_a_starved_optimiser(self, daemon):
        tid = next(int(task.name) for task in pathlib.Path(f"/proc/{daemon.pid}/task").iterdir()
                   if (task / "comm").read_text(encoding="utf-8").strip() == "rv-optimiser")
        libc = ctypes.CDLL(None, use_errno=True)
        held = libc.ptrace(PTRACE_SEIZE, tid, None, None) == 0 and libc.ptrace(PTRACE_INTERRUPT, tid, None, None) == 0
        if not held:
            print("skipped: no thread may be held here:", os.strerror(ctypes.get_errno()))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.bind(("127.0.0.2", 0))
            ended = threading.Event()

            def send():
                while not ended.wait(0.01):
                    other.sendto(bytes(1206), ("127.0.0.1", self.tables["lidar"]["port"]))

            sender = threading.Thread(target=send)
            sender.start()
            try:
                stages = self.wait_for(lidar="ambiguous", **({"optimiser": "stuck"} if held else {}))
            finally:
                ended.set()
                sender.join()
        self.assertIn("127.0.0.1, 127.0.0.2", stages["lidar"]["detail"])
        self.assertGreater(self.count(stages, "lidar", "foreign_source"), 50)
        if held:
            self.assertEqual(self.last["state"], "waiting")
            stages = self.wait_until("keyframes that wait",
                                     lambda: (s := self.stages())["optimiser"]["gauges"]["waiting_keyframes"] > 1 and s)
            os.waitpid(tid, 0x40000000)  # __WALL: the thread has stopped
            self.assertEqual(libc.ptrace(PTRACE_DETACH, tid, None, None), 0)
        taken = self.last["keyframe_count"]
        stages = self.wait_for(lidar="ok", optimiser="ok", mapping="ok")
        if held:
            self.assertGreater(self.last["keyframe_count"], taken)
            self.assertGreater(self.count(stages, "optimiser", "misses"), 0)

    def storm_of_clients(self):
        follower = self.car.enter_context(running("roadvec", "--socket", self.socket, "watch", "--json", "--status"))
        self.assertIn("snapshot", follower.stdout.readline())
        storm = []
        for _ in range(10):
            storm += [self.connection() for _ in range(20)]
            with contextlib.suppress(AssertionError):  # our own question may be turned away too
                self.stages()
        for connection in storm:
            connection.close()
        stages = self.wait_for(server="crowded", limit_s=10)
        self.assertGreater(self.count(stages, "server", "closed_too_many"), 100)
        self.wait_for(server="ok")
        self.assertIsNone(follower.poll(), "whoever was there first was served on")
        latency = {timing["step"]: timing for timing in self.stages()["latency"]["timings"]}
        self.assertEqual(list(latency), ["sweep", "mapped", "optimised", "published", "written"])
        self.assertGreater(latency["written"]["count"], 0)
        self.assertLessEqual(latency["sweep"]["p50_us"], latency["mapped"]["p50_us"])

    def stopped_process(self, daemon):
        before = self.count(self.stages(), "process", "stalls")
        daemon.send_signal(signal.SIGSTOP)
        silent = programs.run("roadvec", "--socket", self.socket, "--timeout", "4", "status", timeout_s=30)
        self.assertEqual(silent.returncode, 3, silent.stderr)
        daemon.send_signal(signal.SIGCONT)
        stages = self.wait_for(process="stalled")
        self.assertEqual(self.count(stages, "process", "stalls"), before + 1)
        self.assertGreater(stages["process"]["gauges"]["longest_stall_s"], 3)
        self.wait_for(process="ok", lidar="ok", can="ok", imu="ok", mapping="ok", optimiser="ok")


if __name__ == "__main__":
    programs.main()
