"""What the tests of the programs share: running them, and drives and configurations made from the simulated drive.

The environment says where things are: ROADVEC_BIN the programs, ROADVEC_SOURCE this repository, ROADVEC_RECORDINGS the real
recordings, ROADVEC_TEST_DRIVE the drive that make_drive.py has made; PYTHONPATH tests/support/python.
"""

import json
import os
import pathlib
import re
import socket
import struct
import subprocess
import tempfile
import tomllib
import unittest

from processes import started

SOURCE = pathlib.Path(os.environ["ROADVEC_SOURCE"])
BIN = pathlib.Path(os.environ["ROADVEC_BIN"])
RECORDINGS = pathlib.Path(os.environ["ROADVEC_RECORDINGS"])
DRIVE = pathlib.Path(os.environ["ROADVEC_TEST_DRIVE"])
PCAP_HEADER_BYTES, RECORD_HEADER_BYTES = 24, 16


def command(program, *arguments):
    return [str(BIN / program), *map(str, arguments)]


def run(program, *arguments, timeout_s=120):
    return subprocess.run(command(program, *arguments), capture_output=True, text=True, timeout=timeout_s, check=False)


def read_json(path):
    return json.loads(pathlib.Path(path).read_text(encoding="utf-8"))


def drive_toml():
    return tomllib.loads((DRIVE / "drive.toml").read_text(encoding="utf-8"))


def toml_text(tables):
    """Tables of plain values, as TOML; JSON writes texts, numbers, truths and lists of them the same way."""
    text = "".join(f"{key} = {json.dumps(value)}\n" for key, value in tables.items() if not isinstance(value, dict))
    for name, table in tables.items():
        if isinstance(table, dict):
            text += f"[{name}]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in table.items())
    return text


def write_pcap_start(target, record_count, part_bytes=0):
    """The first records of the drive's capture, and `part_bytes` of the next."""
    with open(DRIVE / drive_toml()["lidar"]["pcap"], "rb") as file, open(target, "wb") as out:
        out.write(file.read(PCAP_HEADER_BYTES))
        for _ in range(record_count):
            header = file.read(RECORD_HEADER_BYTES)
            out.write(header + file.read(struct.unpack_from("<I", header, 8)[0]))
        out.write(file.read(part_bytes))


def free_udp_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def running(program, *arguments, stdout=subprocess.PIPE):
    return started(command(program, *arguments), stdout=stdout)


class ProgramTest(unittest.TestCase):
    """A test with a folder of its own, self.folder."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="roadvec-")
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def score(self, drive, map_folder, *arguments):
        result = run("roadvec-score", drive, map_folder, "--json", *arguments)
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def copy_of_drive(self, edit=lambda tables: None):
        """The simulated drive in another folder, its drive.toml changed; the other files are links to replace."""
        copy = self.folder / "drive"
        copy.mkdir()
        for entry in DRIVE.iterdir():
            if entry.name != "drive.toml":
                (copy / entry.name).symlink_to(entry)
        tables = drive_toml()
        edit(tables)
        (copy / "drive.toml").write_text(toml_text(tables), encoding="utf-8")
        return copy

    def car_tables(self, **replaced):
        """The configuration of a car that is equipped as the drive's. `replaced`: keys of [lidar] and [vehicle]."""
        tables = drive_toml()
        lidar, vehicle = tables["lidar"], tables["vehicle"]
        lidar["calibration"] = str(DRIVE / lidar["calibration"])
        lidar["port"] = replaced.pop("port", None) or free_udp_port()
        del lidar["pcap"]
        vehicle["dbc"] = str(DRIVE / vehicle["dbc"])
        vehicle["can"] = str(DRIVE / vehicle["can"])
        vehicle.update(replaced)
        car = {name: tables[name] for name in ("lidar", "vehicle", "anchor")}
        car["server"] = {"socket": str(self.folder / "map.sock"), "control_socket": str(self.folder / "control.sock")}
        car["storage"] = {"directory": str(self.folder / "map")}
        car["real_time"] = {"lidar_priority": 0, "vehicle_priority": 0, "mapping_priority": 0, "lock_memory": False}
        return car

    def car_file(self, tables):
        path = self.folder / "car.toml"
        path.write_text(toml_text(tables), encoding="utf-8")
        return path

    def assert_refused(self, result, status, *patterns):
        """It ended with `status`, and said why in one line that matches every pattern."""
        lines = result.stderr.strip().splitlines()
        self.assertEqual(result.returncode, status, result.stderr)
        self.assertEqual(len(lines), 1, result.stderr)
        for pattern in patterns:
            self.assertRegex(lines[0], pattern)

    def assert_rfc_7946(self, geojson):
        """Lines as RFC 7946 wants them: two positions or more, longitude first, in range."""
        self.assertEqual(geojson["type"], "FeatureCollection")
        self.assertNotIn("crs", geojson)
        self.assertGreater(len(geojson["features"]), 0)
        ids = [feature["id"] for feature in geojson["features"]]
        self.assertEqual(len(ids), len(set(ids)))
        anchor = drive_toml()["anchor"]
        for feature in geojson["features"]:
            self.assertEqual(feature["type"], "Feature")
            self.assertIn(feature["properties"]["kind"], ("curb", "barrier", "vegetation", "vehicle_row", "unknown"))
            self.assertEqual(feature["geometry"]["type"], "LineString")
            self.assertGreaterEqual(len(feature["geometry"]["coordinates"]), 2)
            for longitude_deg, latitude_deg, _ in feature["geometry"]["coordinates"]:
                self.assertAlmostEqual(longitude_deg, anchor["longitude_deg"], delta=0.1)
                self.assertAlmostEqual(latitude_deg, anchor["latitude_deg"], delta=0.1)


def main():
    # Colours would come between the words that the tests look for.
    os.environ["NO_COLOR"] = "1"
    unittest.main(verbosity=2)


def counters_of(status, stage):
    """The counters of a stage, in the words of `roadvec status --json` or of report.json."""
    stages = status["stages"]
    if isinstance(stages, dict):
        return stages[stage]["counters"]
    return next(found["counters"] for found in stages if found["name"] == stage)


def line_of(path, pattern):
    """Number of the first line that matches, from 1."""
    lines = pathlib.Path(path).read_text(encoding="utf-8").splitlines()
    return next(number for number, line in enumerate(lines, 1) if re.search(pattern, line))
