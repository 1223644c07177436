"""The package in a fresh machine: makes the .deb, a newer one, a short VLP-16 drive and its map, and has package_story.py tell
the rest: in the guest of run.sh, whose root make_root.sh has made; or, with ROADVEC_HERE in the environment, on this machine,
as root. That needs systemd, vcan and can-utils, and must not have roadvec installed. The rest of the environment is that of
programs.py.
"""

import os
import pathlib
import shutil
import subprocess
import sys
import time

import programs
from programs import BIN, SOURCE, command, toml_text

HERE = SOURCE / "tests/vm"
GUEST_LIMIT_S = 600


def call(*words, **options):
    subprocess.run([str(word) for word in words], check=True, **options)


def make_packages(work):
    call("cpack", "--config", BIN.parent / "CPackConfig.cmake", "-B", work / "cpack", cwd=BIN.parent, stdout=subprocess.DEVNULL)
    (made,) = (work / "cpack").glob("roadvec_*.deb")
    made.rename(work / "roadvec.deb")
    call("dpkg-deb", "--raw-extract", work / "roadvec.deb", work / "newer")
    control = work / "newer/DEBIAN/control"
    control.write_text(control.read_text(encoding="utf-8").replace("\nVersion: ", "\nVersion: 1:"), encoding="utf-8")
    call("dpkg-deb", "--root-owner-group", "-Zgzip", "--build", work / "newer", work / "newer.deb", stdout=subprocess.DEVNULL)


def make_drive(work):
    drive = work / "drive"
    call(*command("roadvec-simulate", "street", drive, "--lidar", "VLP-16", "--duration", 8), stdout=subprocess.DEVNULL)
    programs.DRIVE = drive
    tables = programs.drive_toml()
    tables.pop("imu")  # its device would be a terminal, which the service may not open
    tables["lidar"]["clock"] = "device"  # the guest delivers packets up to 15 ms late
    (drive / "drive.toml").write_text(toml_text(tables), encoding="utf-8")
    call(*command("roadvecd", "--drive", drive, "--out", work / "recorded"), stderr=subprocess.DEVNULL)
    lidar, vehicle = tables["lidar"], tables["vehicle"]
    del lidar["pcap"]
    lidar["port"] = 2368
    vehicle.update(can="vcan0", dbc="/etc/roadvec/car.dbc")
    car = {name: tables[name] for name in ("lidar", "vehicle", "anchor")}
    (work / "car.toml").write_text(toml_text(car), encoding="utf-8")


def in_guest(work):
    root = BIN.parent / "vm/root"
    call(HERE / "make_root.sh", work / "roadvec.deb", root)
    begin = time.monotonic()
    done = subprocess.run([HERE / "run.sh", "-r", root, "-t", str(GUEST_LIMIT_S), "-w", work, "-b",
                           "python3 -B package_story.py before-boot", "python3", "-B", "package_story.py"], check=False)
    print(f"in the guest: {time.monotonic() - begin:.0f} s")
    return done.returncode


def here(work):
    present = subprocess.run(["dpkg-query", "--show", "roadvec"], capture_output=True, check=False).returncode == 0
    if os.getuid() != 0 or present or pathlib.Path("/var/lib/roadvec").exists():
        sys.exit("ROADVEC_HERE: run it as root, where roadvec is not installed and there is no /var/lib/roadvec: both end up purged")
    call("apt-get", "install", "--yes", "--download-only", work / "roadvec.deb")
    return subprocess.run([sys.executable, "-B", "package_story.py"], cwd=work, check=False).returncode


def main():
    work = BIN.parent / "tests/package"
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    make_packages(work)
    make_drive(work)
    shutil.copy(HERE / "package_story.py", work)
    shutil.copy(SOURCE / "tests/support/python/processes.py", work)
    return here(work) if "ROADVEC_HERE" in os.environ else in_guest(work)


if __name__ == "__main__":
    sys.exit(main())
