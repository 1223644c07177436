"""The package on a machine with systemd and vcan, from installing to purging: one story, step by step, as root.

package_test.py starts it, in the guest or on this very machine. The current folder holds what it has made: roadvec.deb,
newer.deb (a higher version), the drive, recorded/ (the drive's map by `roadvecd --drive`) and car.toml, the drive's sensors as
in the car. In the guest the first package is installed before systemd comes up, as it is when a system image is made.
"""

import json
import math
import pathlib
import re
import shutil
import socket
import struct
import subprocess
import sys
import time
import unittest

from processes import started

PACKAGE, NEWER = "./roadvec.deb", "./newer.deb"
CONFIGURATION, STATE = pathlib.Path("/etc/roadvec/roadvecd.toml"), pathlib.Path("/var/lib/roadvec")
CAR_DBC = CONFIGURATION.parent / "car.dbc"
SERVICE, SOCKETS = "roadvecd.service", ("roadvec-lidar.socket", "roadvec-map.socket", "roadvec-control.socket")
WORST_EXPOSURE = 1.5
EARTH_RADIUS_M = 6371000


def shell(command, status=0):
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    if status is not None and done.returncode != status:
        log = journal() if command.startswith("systemctl") else ""
        raise AssertionError(f"{command}: status {done.returncode}\n{done.stdout}{done.stderr}{log}")
    return done.stdout + done.stderr


def show(name, unit=SERVICE):
    return shell(f"systemctl show --value -p {name} {unit}").strip()


def state(unit=SERVICE):
    return show("ActiveState", unit)


def apt(command):
    # There is no network: what the package depends on was downloaded beforehand.
    return shell(f"DEBIAN_FRONTEND=noninteractive apt-get --yes --quiet -o Dpkg::Use-Pty=0 {command}")


def wait_until(what, happened, limit_s=60):
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        if answer := happened():
            return answer
        time.sleep(0.2)
    raise AssertionError(f"{what}: not within {limit_s} s\n" + shell(f"systemctl status --no-pager {SERVICE}", None) + journal())


def journal():
    return shell("journalctl --no-pager --output=cat --lines=60")


def status_of_daemon():
    return json.loads(shell("roadvec status --json", None))  # status 4 while a sensor is silent


def counters(status, stage):
    return next(found["counters"] for found in status["stages"] if found["name"] == stage)


def configure(edit=lambda text: text):
    shutil.copy("drive/vehicle.dbc", CAR_DBC)
    CONFIGURATION.write_text(edit(pathlib.Path("car.toml").read_text(encoding="utf-8")), encoding="utf-8")


def make_bus():
    shell("modprobe -a vcan can_raw; ip link add vcan0 mtu 72 type vcan; ip link set vcan0 up")


def points_of(geojson, spacing_m=0.5):
    """Points along the lines, in metres east and north of no place in particular."""
    for feature in geojson["features"]:
        line = [(math.radians(lon) * EARTH_RADIUS_M * math.cos(math.radians(49)), math.radians(lat) * EARTH_RADIUS_M)
                for lon, lat, *_ in feature["geometry"]["coordinates"]]
        for (x0, y0), (x1, y1) in zip(line, line[1:]):
            count = max(1, int(math.hypot(x1 - x0, y1 - y0) / spacing_m))
            yield from ((x0 + (x1 - x0) * i / count, y0 + (y1 - y0) * i / count) for i in range(count))


def share_within(points, others, distance_m):
    near = sum(1 for x, y in points if any(math.hypot(x - a, y - b) < distance_m for a, b in others))
    return near / len(points)


class PackageStory(unittest.TestCase):
    def main_pid(self):
        return int(show("MainPID"))

    def assert_running(self, not_pid=None):
        wait_until("the service", lambda: state() == "active" and self.main_pid() != not_pid)
        wait_until("an answer", lambda: "epoch" in shell("roadvec status --json", None))

    def test_01_it_is_installed_and_up_soon_after_the_machine(self):
        if shell("dpkg-query --show --showformat='${Status}' roadvec", None) != "install ok installed":
            apt(f"install {PACKAGE}")
            self.assertEqual(state(), "inactive", "the example is somebody else's car")
            make_bus()
            configure()
            shell(f"systemctl start {SERVICE}")
        self.assert_running()
        self.assertEqual(show("UnitFileState"), "enabled")
        ready_s, started_s, systemd_s = (int(show(f"{name}TimestampMonotonic", unit)) * 1e-6 for name, unit in
                                         (("ActiveEnter", SERVICE), ("InactiveExit", SERVICE), ("Userspace", "")))
        print(f"ready {ready_s - systemd_s:.1f} s after systemd's start, {ready_s - started_s:.1f} s after its own")
        print("status:", show("StatusText"))
        self.assertIn("keyframes", wait_until("a status line", lambda: show("StatusText")))

    def test_02_units_are_sound_and_shut_off(self):
        self.assertEqual(shell(f"systemd-analyze verify {SERVICE} {' '.join(SOCKETS)}"), "")
        exposure = shell(f"systemd-analyze security --no-pager {SERVICE}")
        score = float(re.search(r"Overall exposure level for .*: ([0-9.]+)", exposure)[1])
        print(f"systemd-analyze security: {score}")
        self.assertLessEqual(score, WORST_EXPOSURE)
        for page in ("8 roadvecd", "1 roadvec", "1 roadvec-replay", "5 roadvecd.toml"):
            self.assertIn("/man/", shell(f"man -w {page}"))
        self.assertEqual(shell("dpkg --verify roadvec | grep -v /etc/roadvec/roadvecd.toml", None), "")

    def test_03_it_has_a_user_of_its_own_no_rights_and_real_time(self):
        process = pathlib.Path(f"/proc/{self.main_pid()}")
        status = dict(line.split(":", 1) for line in (process / "status").read_text(encoding="utf-8").splitlines())
        self.assertEqual(set(status["Uid"].split()), {shell("id -u roadvec").strip()})
        for name in ("CapEff", "CapPrm", "CapBnd"):
            self.assertEqual(int(status[name], 16), 0, name)
        self.assertGreater(int(status["VmLck"].split()[0]), 0)
        priorities = {}
        for task in (process / "task").iterdir():
            fields = (task / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()
            priorities[(task / "comm").read_text(encoding="utf-8").strip()] = int(fields[37])
        self.assertEqual({name: priorities[name] for name in ("rv-lidar", "rv-vehicle", "rv-mapping", "rv-server")},
                         {"rv-lidar": 40, "rv-vehicle": 40, "rv-mapping": 30, "rv-server": 0})

    def test_04_its_sockets_are_those_that_systemd_has_opened(self):
        self.assertEqual(shell("stat -c '%a %U %G' /run/roadvec/map.sock").strip(), "660 roadvec roadvec")
        self.assertEqual(shell("stat -c '%a %U %G' /run/roadvec/control.sock").strip(), "600 roadvec roadvec")
        for port in (2368, 8308):
            listed = shell(f"ss --udp --listening --numeric --memory --processes 'sport = {port}'")
            self.assertIn("systemd", listed)
            self.assertIn("roadvecd", listed)
            self.assertGreaterEqual(int(re.search(r"rb(\d+)", listed)[1]), 2 * 16 << 20, listed)
        self.assertNotIn("receive buffer", journal())

    def test_05_a_drive_on_its_sensors_gives_the_map_of_the_recording(self):
        with started("roadvec watch --json".split()) as watcher:
            wait_until("the watcher", lambda: counters(status_of_daemon(), "server")["clients_connected"] > 1)
            played = self.play()
            status = self.settled()
            shell("roadvec export geojson -o live.geojson")
            exported = json.loads(pathlib.Path("live.geojson").read_text(encoding="utf-8"))
            shell(f"systemctl stop {SERVICE}")
            watched = watcher.communicate(timeout=30)[0]
            shell(f"systemctl start {SERVICE}")
        self.check_counters(status, played)
        self.check_watched(watched)
        self.check_map(exported, status)
        kept = json.loads(shell(f"roadvec export geojson --map {STATE / 'map.gpkg'}"))
        self.assertEqual(len(kept["features"]), len(exported["features"]))

    def play(self):
        """LiDAR and CAN by two players, as far apart as in the recording: canplayer gets its log when the first packet is out."""
        log = pathlib.Path("drive/can.log").read_bytes()
        with open("drive/lidar.pcap", "rb") as pcap:  # nanosecond
            seconds, nanoseconds = struct.unpack("<II", pcap.read(32)[24:])
        later_s = float(re.match(rb"\(([0-9.]+)\)", log)[1]) - seconds - nanoseconds * 1e-9
        with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(0x0800)) as wire:
            wire.bind(("lo", 0))
            wire.settimeout(60)
            with started("roadvec-replay drive --position-port 0 --json".split()) as replay:
                with subprocess.Popen(["canplayer", "vcan0=can0"], stdin=subprocess.PIPE) as canplayer:
                    while len(wire.recv(2048)) < 1206:
                        pass
                    time.sleep(max(0, later_s))
                    canplayer.communicate(log, timeout=60)
                played = replay.communicate(timeout=60)[0]
        return json.loads(played)

    def settled(self):
        seen = []

        def settle():
            status = status_of_daemon()
            seen.append((status["head_seq"], counters(status, "mapping")["sweeps"], counters(status, "vehicle")["samples"]))
            return status if len(seen) > 10 and seen[-1] == seen[-10] and seen[-1][1] > 0 else None

        return wait_until("the end of the drive", settle, 120)

    def check_counters(self, status, played):
        recorded = json.loads(pathlib.Path("recorded/report.json").read_text(encoding="utf-8"))["stages"]
        lidar, vehicle = counters(status, "lidar"), counters(status, "vehicle")
        sent_count = next(track["sent_count"] for track in played["tracks"] if track["name"] == "lidar")
        self.assertEqual(sent_count, recorded["lidar"]["counters"]["received"])
        self.assertEqual(lidar["received"] + lidar["kernel_drops"], sent_count)
        self.assertEqual(vehicle["samples"] + vehicle["ring_full"], recorded["vehicle"]["counters"]["samples"])
        self.assertEqual(counters(status, "can")["kernel_drops"], 0)
        # The last revolution is open as long as more may come.
        sweeps = recorded["lidar"]["counters"]["sweeps"] - 1
        if lidar["kernel_drops"] == 0:
            # A player that stalls for longer than half a second looks like a clock that was set, which ends a sweep early.
            self.assertIn(lidar["sweeps"] + lidar["ring_full"] - sweeps, range(lidar["clock_steps"] + 1), lidar)
        self.assertLess(lidar["ring_full"], 0.2 * sweeps)
        print(f"packets {lidar['received']} of {sent_count}, sweeps {lidar['sweeps']} of {sweeps}, {lidar['ring_full']} refused")

    def check_watched(self, text):
        messages = [json.loads(line) for line in text.splitlines()]
        self.assertEqual(messages[0]["type"], "snapshot")
        changes = [message["seq"] for message in messages if message["type"] in ("delta", "epoch_change")]
        self.assertGreater(len(changes), 3)
        self.assertEqual(changes, list(range(changes[0], changes[0] + len(changes))))

    def check_map(self, exported, status):
        recorded = json.loads(pathlib.Path("recorded/map.geojson").read_text(encoding="utf-8"))
        live_points, recorded_points = list(points_of(exported)), list(points_of(recorded))
        shares = share_within(live_points, recorded_points, 0.5), share_within(recorded_points, live_points, 0.5)
        print(f"map: {len(live_points) / 2:.0f} m live, {len(recorded_points) / 2:.0f} m recorded; within 0.5 m of the other: "
              f"{shares[0]:.3f}, {shares[1]:.3f}")
        lost = counters(status, "lidar")["ring_full"] / counters(status, "lidar")["sweeps"]
        for share in shares:
            self.assertGreater(share, 0.9 - lost)

    def test_06_a_reload_applies_what_it_can_and_refuses_what_is_wrong(self):
        pid = self.main_pid()
        configure(lambda text: text.replace("port = 2368", "port = 2369") + '[log]\nlevel = "debug"\n')
        shell(f"systemctl reload {SERVICE}")
        wait_until("the reload", lambda: 'log.level: "info" -> "debug": applied' in journal())
        self.assertIn("lidar.port: 2368 -> 2369: needs a restart", journal())
        configure(lambda text: text.replace("port = 2368", "prot = 2368"))
        self.assertIn("failed", shell(f"systemctl reload {SERVICE}", 1))
        self.assertRegex(journal(), r"roadvecd.toml:\d+: key 'lidar.prot': unknown; did you mean")
        shell(f"systemctl kill --signal=HUP {SERVICE}")
        wait_until("the refusal", lambda: "everything goes on as configured before" in journal())
        wait_until("the end of the reload", lambda: state() == "active")
        self.assertEqual(self.main_pid(), pid)
        configure()

    def test_07_a_daemon_that_hangs_or_dies_is_started_again_while_packets_come(self):
        with started("roadvec-replay drive --position-port 0 --loop --speed 0.1".split()):
            wait_until("packets", lambda: counters(status_of_daemon(), "lidar")["received"] > 0)
            pid = self.main_pid()
            shell(f"systemctl kill --kill-whom=main --signal=STOP {SERVICE}")
            self.assert_running(not_pid=pid)
            self.assertIn("Watchdog timeout", journal())
            print("the watchdog has started it again")
            pid = self.main_pid()
            shell(f"systemctl kill --kill-whom=main --signal=KILL {SERVICE}")
            with started("roadvec --timeout 60 status --json".split()) as client:  # waits in the socket until it is served
                complaint = client.communicate(timeout=60)[1]
                self.assertIn(client.returncode, (0, 4), complaint + journal())
            self.assert_running(not_pid=pid)
            wait_until("packets", lambda: counters(status_of_daemon(), "lidar")["received"] > 0)
            self.assertEqual(counters(status_of_daemon(), "lidar")["kernel_drops"], 0, "those before the start are not ours")

    def test_08_what_is_stopped_or_wrong_stays_so_while_packets_come(self):
        with started("roadvec-replay drive --position-port 0 --loop --speed 0.1".split()):
            shell(f"systemctl stop {SERVICE}")
            time.sleep(3)
            self.assertEqual([state(unit) for unit in (SERVICE, *SOCKETS)], ["inactive"] * 4)
            configure(lambda text: text.replace("[lidar]", "[lidra]"))
            shell(f"systemctl start {SERVICE}", 1)
            time.sleep(3)
            self.assertEqual([state(unit) for unit in (SERVICE, *SOCKETS)], ["failed", "inactive", "inactive", "inactive"])
            self.assertEqual((show("ExecMainStatus"), show("NRestarts")), ("78", "0"))
            self.assertRegex(show("StatusText"), "wrong configuration: .*roadvecd.toml:")
            configure()
            shell(f"systemctl start {SERVICE}")
            self.assert_running()

    def test_09_upgrades_keep_it_running_as_it_was_configured(self):
        for package in (PACKAGE, NEWER):
            pid, configured = self.main_pid(), CONFIGURATION.read_text(encoding="utf-8")
            apt(f"install --reinstall {package}")
            self.assert_running(not_pid=pid)
            self.assertEqual(CONFIGURATION.read_text(encoding="utf-8"), configured)
        self.assertEqual(shell("dpkg-query --show --showformat='${Version}' roadvec"), shell(f"dpkg-deb --field {NEWER} Version").strip())
        self.assertEqual(show("NRestarts"), "0")
        shell(f"systemctl disable --now {SERVICE}")
        apt(f"install --reinstall {NEWER}")
        self.assertEqual((show("UnitFileState"), state()), ("disabled", "inactive"))

    def test_10_it_is_removed_and_its_maps_stay_until_the_purge(self):
        shell(f"systemctl enable --now {SERVICE}")
        apt("remove roadvec")
        self.assertEqual(show("LoadState"), "masked")
        self.assertFalse(pathlib.Path("/usr/sbin/roadvecd").exists() or pathlib.Path("/run/roadvec").exists())
        self.assertTrue((STATE / "map.gpkg").exists() and CONFIGURATION.exists())
        CAR_DBC.unlink()
        apt("purge roadvec")
        self.assertEqual([path for path in (STATE, CONFIGURATION.parent) if path.exists()], [])
        self.assertEqual(show("LoadState"), "not-found")
        self.assertEqual(shell("find / -xdev -name '*roadvec*' -path '/etc/*'"), "")

    def test_11_it_is_installed_anew_and_waits_to_be_told_which_car(self):
        apt(f"install {PACKAGE}")
        self.assertEqual((show("UnitFileState"), state()), ("enabled", "inactive"))
        self.assertIn("is still the example", journal())
        apt("purge roadvec")


if __name__ == "__main__":
    if sys.argv[1:] == ["before-boot"]:
        make_bus()
        apt(f"install {PACKAGE}")
        configure()
        sys.exit()
    sys.stdout.reconfigure(line_buffering=True)
    unittest.main(verbosity=2, failfast=True)
