"""roadvecd under a service manager: sockets that are handed over, what it tells about itself, SIGHUP. Here the test is the manager."""

import json
import os
import signal
import socket
import time

import programs
from processes import started
from programs import ProgramTest, command, counters_of, free_udp_port, run

FIRST_HANDED_OVER = 3  # SD_LISTEN_FDS_START
SO_RCVBUFFORCE = 33


class ServiceTest(ProgramTest):
    def setUp(self):
        super().setUp()
        self.notices = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.addCleanup(self.notices.close)
        self.notices.bind(str(self.folder / "notify"))
        self.notices.settimeout(20)
        self.port, self.position_port = free_udp_port(), free_udp_port()
        self.tables = self.car_tables(port=self.port)
        self.tables["lidar"]["position_port"] = self.position_port

    def udp_socket(self, port, family=socket.AF_INET):
        udp = socket.socket(family, socket.SOCK_DGRAM)
        self.addCleanup(udp.close)
        udp.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE if os.getuid() == 0 else socket.SO_RCVBUF, 16 << 20)
        udp.bind(("", port))
        return udp

    def unix_socket(self, name):
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.addCleanup(listener.close)
        listener.bind(str(self.folder / name))
        listener.listen()
        return listener

    def daemon(self, handed_over, names):
        """roadvecd with sockets at the descriptors 3, 4, …, as sd_listen_fds(3) has them."""
        def place():
            high = [os.dup2(given.fileno(), 100 + i) for i, given in enumerate(handed_over)]
            for i, descriptor in enumerate(high):
                os.dup2(descriptor, FIRST_HANDED_OVER + i)

        begin = ["sh", "-c", 'LISTEN_PID=$$ exec "$@"', "sh", *command("roadvecd", "--config", self.car_file(self.tables))]
        surroundings = {**os.environ, "NOTIFY_SOCKET": str(self.folder / "notify")}
        if handed_over:
            surroundings.update(LISTEN_FDS=str(len(handed_over)), LISTEN_FDNAMES=names)
        return started(begin, env=surroundings, preexec_fn=place, close_fds=False)

    def wait_for_notice(self, wanted):
        while True:
            notice = self.notices.recv(4096).decode()
            if wanted in notice:
                return notice

    def log_after_stop(self, daemon):
        daemon.send_signal(signal.SIGTERM)
        log = daemon.communicate(timeout=30)[1]
        self.assertEqual(daemon.returncode, 0, log)
        return log

    def status(self):
        return json.loads(run("roadvec", "--socket", self.folder / "map.sock", "status", "--json").stdout)

    def send(self, port, datagram):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            sender.sendto(datagram, ("127.0.0.1", port))

    def test_sockets_that_are_handed_over_are_used_and_left_to_their_giver(self):
        data, position = self.udp_socket(self.port), self.udp_socket(self.position_port)
        for _ in range(5):
            self.send(self.port, bytes(1206))
        sockets = [self.unix_socket("control.sock"), self.unix_socket("map.sock"), position, data]
        with self.daemon(sockets, "control:map:lidar:lidar") as daemon:
            self.wait_for_notice("READY=1")
            begun = run("roadvec", "control", "new-map", "--control-socket", self.folder / "control.sock")
            self.assertEqual(begun.returncode, 0, begun.stderr)
            self.send(self.port, b"short")
            self.send(self.position_port, b"short")
            end = time.monotonic() + 20
            while counters_of(self.status(), "lidar")["position_wrong_length"] == 0 and time.monotonic() < end:
                time.sleep(0.1)
            lidar = counters_of(self.status(), "lidar")
            self.assertEqual((lidar["before_start"], lidar["wrong_length"], lidar["position_wrong_length"]), (5, 1, 1))
            self.assertNotIn("receive buffer", self.log_after_stop(daemon))
        self.assertTrue((self.folder / "map.sock").exists() and (self.folder / "control.sock").exists())

    def test_a_port_that_nobody_wants_is_named_and_the_wanted_one_opened(self):
        other = free_udp_port()
        with self.daemon([self.udp_socket(other)], "lidar") as daemon:
            self.wait_for_notice("READY=1")
            log = self.log_after_stop(daemon)
        self.assertRegex(log, rf"hands over UDP port {other}, which no key .*lidar.port \({self.port}\)")

    def test_sockets_of_another_kind_are_refused_with_what_to_write(self):
        if socket.has_dualstack_ipv6():
            with self.daemon([self.udp_socket(self.port, socket.AF_INET6)], "lidar") as daemon:
                self.assertIn("ListenDatagram=0.0.0.0:2368", daemon.communicate(timeout=20)[1])
                self.assertEqual(daemon.returncode, 1)
        with self.daemon([self.unix_socket("map.sock")], "other") as daemon:
            self.assertIn("FileDescriptorName=map", daemon.communicate(timeout=20)[1])
            self.assertEqual(daemon.returncode, 1)

    def test_sighup_applies_the_log_level_names_the_rest_and_survives_a_wrong_file(self):
        with self.daemon([], "") as daemon:
            self.wait_for_notice("READY=1")
            self.tables["log"] = {"level": "debug"}
            self.tables["lidar"]["x_m"] = 1.25
            self.reload(daemon)
            (self.folder / "car.toml").write_text("[lidar]\nmodle = 1\n", encoding="utf-8")
            daemon.send_signal(signal.SIGHUP)
            self.wait_for_notice("RELOADING=1\nMONOTONIC_USEC=")
            self.wait_for_notice("READY=1")
            self.assertEqual(self.status()["state"], "waiting")
            log = self.log_after_stop(daemon)
        self.assertIn('log.level: "info" -> "debug": applied', log)
        self.assertRegex(log, r"lidar.x_m: \S+ -> 1.25: needs a restart")
        self.assertRegex(log, r"car.toml:2: key 'lidar.modle': unknown; did you mean 'lidar.model'")
        self.assertIn("goes on as configured before", log)
        self.assertRegex(log, r"debug.*sweeps")

    def reload(self, daemon):
        self.car_file(self.tables)
        daemon.send_signal(signal.SIGHUP)
        self.wait_for_notice("RELOADING=1\nMONOTONIC_USEC=")
        self.wait_for_notice("READY=1")


if __name__ == "__main__":
    programs.main()
