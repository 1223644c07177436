"""What can be wrong with a drive, a configuration or a machine: the programs say so in one line, and how it ends is known."""

import errno
import os
import re
import socket

import programs
from programs import DRIVE, SOURCE, ProgramTest, counters_of, drive_toml, line_of, read_json, run, toml_text, write_pcap_start

FAILURE, USAGE, NO_DAEMON, CONFIG = 1, 2, 3, 78


class DriveErrors(ProgramTest):
    def map_drive(self, drive):
        return run("roadvecd", "--drive", drive, "--out", self.folder / "map")

    def replace(self, drive, name, text):
        (drive / name).unlink()
        (drive / name).write_text(text, encoding="utf-8")

    def test_a_score_without_a_map_or_without_truth(self):
        self.assert_refused(run("roadvec-score", DRIVE, self.folder / "none"), FAILURE, "none/map.geojson", "roadvecd --drive")
        drive = self.copy_of_drive()
        (drive / "truth").unlink()
        self.assert_refused(run("roadvec-score", drive, self.folder), FAILURE, "truth/", "--kerbs")
        self.assertEqual(run("roadvec-score", DRIVE).returncode, USAGE)

    def test_a_missing_drive(self):
        self.assert_refused(self.map_drive(self.folder / "none"), CONFIG, "none/drive.toml", "cannot read")

    def test_missing_files(self):
        drive = self.copy_of_drive()
        for table, key in (("lidar", "pcap"), ("lidar", "calibration"), ("vehicle", "can"), ("vehicle", "dbc"), ("imu", "log")):
            with self.subTest(key=key):
                tables = drive_toml()
                tables[table][key] = "none.file"
                (drive / "drive.toml").write_text(toml_text(tables), encoding="utf-8")
                line = line_of(drive / "drive.toml", "none.file")
                self.assert_refused(self.map_drive(drive), CONFIG, f"drive.toml:{line}: ", f"'{table}.{key}'", "none.file'")

    def test_an_unknown_model(self):
        drive = self.copy_of_drive(lambda tables: tables["lidar"].update(model="HDL-65"))
        line = line_of(drive / "drive.toml", "HDL-65")
        self.assert_refused(self.map_drive(drive), CONFIG, f"drive.toml:{line}:", "lidar.model", "HDL-64E S2")

    def test_an_hdl_64e_without_calibration(self):
        drive = self.copy_of_drive(lambda tables: tables["lidar"].pop("calibration"))
        self.assert_refused(self.map_drive(drive), FAILURE, "HDL-64E", "calibration")

    def test_an_unknown_key(self):
        drive = self.copy_of_drive(lambda tables: tables["vehicle"].update(wheelbse_m=2.7))
        line = line_of(drive / "drive.toml", "wheelbse_m")
        self.assert_refused(self.map_drive(drive), CONFIG, f"drive.toml:{line}: ", "'vehicle.wheelbse_m'",
                            "did you mean 'vehicle.wheelbase_m'")

    def test_a_double_key(self):
        drive = self.copy_of_drive()
        text = (drive / "drive.toml").read_text(encoding="utf-8")
        line = line_of(drive / "drive.toml", "^x_m = ")
        self.replace(drive, "drive.toml", text.replace("\nx_m = ", "\nx_m = 1.0\nx_m = "))
        self.assert_refused(self.map_drive(drive), CONFIG, f"drive.toml:{line + 1}: ", "x_m")

    def test_a_truncated_capture_is_mapped_as_far_as_it_goes(self):
        drive = self.copy_of_drive()
        (drive / "lidar.pcap").unlink()
        write_pcap_start(drive / "lidar.pcap", 14_000, part_bytes=700)
        result = self.map_drive(drive)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(len(re.findall(r"lidar\.pcap.*cut off", result.stderr)), 1, result.stderr)
        report = read_json(self.folder / "map/report.json")
        self.assertEqual(counters_of(report, "lidar")["received"], 14_000)
        self.assertGreater(report["keyframes"], 0)
        self.assert_rfc_7946(read_json(self.folder / "map/map.geojson"))

    def test_a_broken_line_in_the_dbc_costs_that_line_alone(self):
        drive = self.copy_of_drive()
        text = (DRIVE / "vehicle.dbc").read_text(encoding="utf-8")
        self.replace(drive, "vehicle.dbc", "BO_ 12x Broken: 8 Car\n SG_ Half : 0|\n" + text)
        result = self.map_drive(drive)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertGreater(read_json(self.folder / "map/report.json")["map_length_m"], 0)

    def test_a_signal_that_the_dbc_has_not(self):
        drive = self.copy_of_drive(lambda tables: tables["vehicle"].update(steering_signal="Nothing.Here"))
        self.assert_refused(self.map_drive(drive), FAILURE, "Nothing.Here")

    def test_a_fifo_is_no_log_of_a_drive(self):
        drive = self.copy_of_drive()
        (drive / "can.log").unlink()
        os.mkfifo(drive / "can.log")
        self.assert_refused(self.map_drive(drive), FAILURE, "can.log", "FIFO")

    def test_an_output_folder_that_cannot_be_written_is_refused_before_anything_is_mapped(self):
        (self.folder / "map").write_text("a file in the way", encoding="utf-8")
        self.assert_refused(self.map_drive(DRIVE), FAILURE, "cannot make the directory .*/map")
        if os.geteuid() != 0:  # nobody forbids root to write
            (self.folder / "map").unlink()
            (self.folder / "map").mkdir(mode=0o500)
            self.assert_refused(self.map_drive(DRIVE), FAILURE, "cannot write into the directory .*/map")


class CommandLine(ProgramTest):
    def test_wrong_usage_ends_with_2(self):
        self.assert_refused(run("roadvecd", "--drive", DRIVE), USAGE, "--out")
        self.assertEqual(run("roadvecd", "--drvie", DRIVE).returncode, USAGE)
        self.assertEqual(run("roadvec", "frobnicate").returncode, USAGE)
        self.assertEqual(run("roadvec").returncode, USAGE)
        self.assertEqual(run("roadvec-replay").returncode, USAGE)
        self.assertEqual(run("roadvec-simulate").returncode, USAGE)

    def test_every_program_has_help_and_a_version(self):
        for program in ("roadvecd", "roadvec", "roadvec-replay", "roadvec-inspect", "roadvec-simulate"):
            help_text, version = run(program, "--help"), run(program, "--version")
            self.assertEqual((help_text.returncode, version.returncode), (0, 0), program)
            self.assertIn("exit status", help_text.stdout.lower(), program)
            self.assertRegex(version.stdout, rf"^{program} \d+\.\d+\.\d+\n$")

    def test_a_configuration_can_be_checked(self):
        good = self.car_file(self.car_tables())
        result = run("roadvecd", "--config", good, "--check-config")
        self.assertEqual((result.returncode, result.stdout), (0, f"{good}: ok\n"), result.stderr)
        self.assertEqual(run("roadvecd", "--drive", DRIVE, "--check-config").returncode, 0)
        tables = self.car_tables()
        tables["lidar"]["port"] = 14_0000
        bad = self.car_file(tables)
        line = line_of(bad, "^port")
        self.assert_refused(run("roadvecd", "--config", bad, "--check-config"), CONFIG, f"car.toml:{line}: ", "lidar.port",
                            "65535")
        self.assert_refused(run("roadvecd", "--config", self.folder / "none.toml", "--check-config"), CONFIG, "none.toml")

    def test_what_print_config_prints_is_a_configuration(self):
        printed = run("roadvecd", "--print-config")
        self.assertEqual(printed.returncode, 0)
        path = self.folder / "printed.toml"
        (self.folder / "vehicles").symlink_to(SOURCE / "config/vehicles")  # where the example has its DBC
        path.write_text(printed.stdout, encoding="utf-8")
        result = run("roadvecd", "--config", path, "--check-config")
        self.assertEqual((result.returncode, result.stderr), (0, ""))

    def test_without_a_daemon_the_client_says_what_to_do(self):
        for words in (["status"], ["tiles"], ["watch"], ["export", "geojson"], ["render"]):
            result = run("roadvec", "--socket", self.folder / "none.sock", *words)
            self.assert_refused(result, NO_DAEMON, "none.sock", "roadvecd")


class CarErrors(ProgramTest):
    def start(self, tables, *arguments):
        return run("roadvecd", "--config", self.car_file(tables), *arguments, timeout_s=20)

    def test_a_port_in_use(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.bind(("0.0.0.0", 0))
            port = other.getsockname()[1]
            self.assert_refused(self.start(self.car_tables(port=port)), FAILURE, str(port), "in use")

    def test_a_can_interface_that_is_not_there(self):
        try:
            socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
            reason = "nocan7"
        except OSError as error:
            self.assertIn(error.errno, (errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT))
            reason = "this kernel has no CAN"
        self.assert_refused(self.start(self.car_tables(can="nocan7")), FAILURE, "nocan7", reason)

    def test_a_serial_line_that_is_not_there(self):
        tables = self.car_tables()
        tables["imu"] = {"protocol": "xsens", "device": str(self.folder / "ttyUSB7"), "roll_deg": 0.0, "pitch_deg": 0.0,
                         "yaw_deg": 0.0}
        self.assert_refused(self.start(tables), FAILURE, "ttyUSB7", "no such device")

    def test_a_socket_that_cannot_be_made(self):
        tables = self.car_tables()
        tables["server"]["socket"] = str(self.folder / "none/map.sock")
        self.assert_refused(self.start(tables), FAILURE, "none/map.sock", "folder")

    def test_an_output_folder_that_cannot_be_made(self):
        """Without --out it maps, says so and waits: store_test."""
        out = self.folder / "map"
        out.write_text("a file in the way", encoding="utf-8")
        self.assert_refused(self.start(self.car_tables(), "--out", out), FAILURE, "cannot make the directory .*/map")

    def test_a_car_without_an_anchor(self):
        tables = self.car_tables()
        del tables["anchor"]
        self.assert_refused(self.start(tables), FAILURE, "anchor")


if __name__ == "__main__":
    programs.main()
