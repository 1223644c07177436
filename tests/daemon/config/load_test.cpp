#include "daemon/config/load.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

namespace roadvec {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

/// A folder of its own with the files a configuration may name.
class Config : public ::testing::Test {
 protected:
  Config() {
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "truth");
    for (const char* file : {"db.xml", "lidar.pcap", "can.log", "imu.log", "vehicle.dbc"})
      std::ofstream(folder_ / file) << "x";
  }
  ~Config() override { fs::remove_all(folder_); }

  void write(const std::string& file, const std::string& text) const { std::ofstream(folder_ / file) << text; }
  Expected<Settings> parse(const std::string& text, ConfigContext context = ConfigContext::car) const {
    return parse_settings(text, "f.toml", folder_, context);
  }

  const fs::path folder_ =
      fs::path(::testing::TempDir()) /
      ("roadvec_config_" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
};

const std::string kLidar = R"([lidar]
model = "HDL-64E S2"
x_m = 0.76
y_m = 0
z_m = 1.73
roll_deg = 0.08
pitch_deg = 0.62
yaw_deg = -0.33
)";
const std::string kVehicle = R"([vehicle]
wheelbase_m = 2.71
track_m = 1.55
steering_ratio = 15.0
can = "can0"
dbc = "vehicle.dbc"
steering_signal = "SteeringSensor.SteeringWheelAngle"
wheel_speed_signals = ["W.FL", "W.FR", "W.RL", "W.RR"]
)";
const std::string kCar = kLidar + kVehicle;  // [lidar] is line 1, [vehicle] line 9
const std::string kDrive = R"(source = "hand-made"
[lidar]
model = "HDL-64E S2"
calibration = "db.xml"
pcap = "lidar.pcap"
# sensor in the vehicle frame
x_m = 0.7600
y_m = 0.0000
z_m = 1.7300
roll_deg = 0.0773
pitch_deg = 0.6160
yaw_deg = -0.3300

[vehicle]
wheelbase_m = 2.71
track_m = 1.55
steering_ratio = 15.0
can = "can.log"
dbc = "vehicle.dbc"
steering_signal = "SteeringSensor.SteeringWheelAngle"
wheel_speed_signals = ["WheelSpeeds.WheelSpeedFL", "WheelSpeeds.WheelSpeedFR", "WheelSpeeds.WheelSpeedRL", "WheelSpeeds.WheelSpeedRR"]

[imu]
protocol = "xsens"
log = "imu.log"
roll_deg = 0.9262
pitch_deg = 0.5001
yaw_deg = -0.3752

[anchor]
latitude_deg = 49.011222259
longitude_deg = 8.422878262
height_m = 111.810
yaw_deg = -70.9824     # ENU: 0 = east, counter-clockwise
)";

TEST_F(Config, a_car_needs_only_its_own_facts) {
  const auto settings = parse(kCar);
  ASSERT_TRUE(settings) << settings.error().message;
  EXPECT_EQ(settings->lidar.model, "HDL-64E S2");
  EXPECT_EQ(settings->lidar.y_m, 0.0);
  EXPECT_EQ(settings->lidar.port, 2368);
  EXPECT_EQ(settings->lidar.mounting.yaw_deg, -0.33);
  ASSERT_TRUE(settings->vehicle);
  EXPECT_EQ(settings->vehicle->can, "can0");
  EXPECT_EQ(settings->vehicle->dbc, folder_ / "vehicle.dbc");
  EXPECT_EQ(settings->vehicle->wheel_speed_signals.size(), 4U);
  EXPECT_FALSE(settings->imu);
  EXPECT_FALSE(settings->anchor);
}

TEST_F(Config, a_drive_has_its_files_in_its_folder) {
  write("drive.toml", kDrive);
  write("truth/poses.tum", "");
  const auto settings = load_drive(folder_);
  ASSERT_TRUE(settings) << settings.error().message;
  EXPECT_EQ(settings->source, "hand-made");
  EXPECT_EQ(settings->lidar.pcap, folder_ / "lidar.pcap");
  EXPECT_EQ(settings->lidar.calibration, folder_ / "db.xml");
  EXPECT_EQ(settings->vehicle->can, (folder_ / "can.log").native());
  EXPECT_EQ(settings->imu->log, folder_ / "imu.log");
  EXPECT_EQ(settings->imu->mounting.roll_deg, 0.9262);
  EXPECT_EQ(settings->anchor->latitude_deg, 49.011222259);
  EXPECT_EQ(settings->truth.poses, folder_ / "truth/poses.tum");
  EXPECT_TRUE(settings->truth.boundaries.empty());
}

TEST_F(Config, a_drive_takes_the_rest_from_a_configuration_file) {
  write("drive.toml", kDrive);
  write("car.toml", kCar + "[simplify]\ntolerance_m = 0.123\n[log]\nlevel = \"debug\"\n");
  const auto settings = load_drive(folder_, folder_ / "car.toml");
  ASSERT_TRUE(settings) << settings.error().message;
  EXPECT_EQ(settings->pipeline.simplify.tolerance_m, 0.123);
  EXPECT_EQ(settings->log.level, LogLevel::debug);
  EXPECT_EQ(settings->vehicle->can, (folder_ / "can.log").native());

  write("steps.toml", "[simplify]\ntolerance_m = 0.2\n");
  const auto steps_only = load_drive(folder_, folder_ / "steps.toml");
  ASSERT_TRUE(steps_only) << steps_only.error().message;
  EXPECT_EQ(steps_only->pipeline.simplify.tolerance_m, 0.2);
}

TEST_F(Config, signals_may_be_sums_with_sign_validity_and_scale) {
  std::string text = kCar;
  text.replace(
      text.find("\"SteeringSensor.SteeringWheelAngle\""), 35,
      R"({ sum = ["S.ANGLE", "S.FRACTION"], sign = "S.LEFT", valid = "S.OK", valid_raw = 3, invalid_raw = 0, unit = "rad", scale = -0.5 })");
  const auto settings = parse(text);
  ASSERT_TRUE(settings) << settings.error().message;
  EXPECT_EQ(settings->vehicle->steering_signal, (SignalSettings{.sum = {"S.ANGLE", "S.FRACTION"},
                                                                .sign = "S.LEFT",
                                                                .valid = "S.OK",
                                                                .unit = "rad",
                                                                .scale = -0.5,
                                                                .valid_raw = 3,
                                                                .invalid_raw = 0}));
}

TEST_F(Config, messages_may_be_checked_by_counter_checksum_and_time_out) {
  const auto settings = parse(std::string(kCar) +
                              R"(messages = [{ message = "A", counter = "COUNTER", checksum = "SUM", kind = "toyota" },
                                             { message = "B", timeout_ms = 50 }])");
  ASSERT_TRUE(settings) << settings.error().message;
  MessageSettings a, b;
  a.message = "A";
  a.counter = "COUNTER";
  a.checksum = "SUM";
  a.kind = ChecksumKind::toyota;
  b.message = "B";
  b.timeout_ms = 50;
  EXPECT_THAT(settings->vehicle->messages, testing::ElementsAre(a, b));
}

TEST_F(Config, a_fifo_takes_the_place_of_the_can_interface) {
  std::string text = kCar;
  text.replace(text.find("\"can0\""), 6, "\"./can.fifo\"");
  const auto settings = parse(text);
  ASSERT_TRUE(settings) << settings.error().message;
  EXPECT_EQ(settings->vehicle->can, (folder_ / "can.fifo").native());
}

TEST_F(Config, the_imu_may_be_on_the_can_bus) {
  const std::string imu =
      "[imu]\nprotocol = \"can\"\nroll_deg = 0\npitch_deg = 0\nyaw_deg = 0\nrate_z_signal = \"G.YAW\"\n";
  const auto settings = parse(kCar + imu);
  ASSERT_TRUE(settings) << settings.error().message;
  EXPECT_EQ(settings->imu->rate_z_signal.sum, std::vector<std::string>{"G.YAW"});
  const auto alone = parse(kLidar + imu);
  ASSERT_FALSE(alone);
  EXPECT_THAT(alone.error().message, HasSubstr("f.toml:9: key 'imu.can': missing"));
}

struct Fault {
  const char* name;
  const char* old_text;  ///< replaced by new_text in kCar; empty: new_text is appended
  const char* new_text;
  const char* expected;  ///< part of the error
};

class FaultyConfig : public Config, public ::testing::WithParamInterface<Fault> {};

TEST_P(FaultyConfig, is_refused_with_file_line_and_key) {
  const Fault& fault = GetParam();
  std::string text = kCar;
  if (*fault.old_text) {
    ASSERT_NE(text.find(fault.old_text), std::string::npos);
    text.replace(text.find(fault.old_text), std::string(fault.old_text).size(), fault.new_text);
  } else {
    text += fault.new_text;
  }
  const auto settings = parse(text);
  ASSERT_FALSE(settings);
  EXPECT_THAT(settings.error().message, HasSubstr(fault.expected));
  EXPECT_EQ(settings.error().message.find('\n'), std::string::npos)
      << "one fault, one line: " << settings.error().message;
}

INSTANTIATE_TEST_SUITE_P(
    Each, FaultyConfig,
    ::testing::Values(
        Fault{"unknown_key", "z_m = 1.73", "z_m = 1.73\nz_mm = 1",
              "f.toml:6: key 'lidar.z_mm': unknown; did you mean 'lidar.z_m'?"},
        Fault{"unknown_table", "", "[simplyfy]\ntolerance_m = 0.1\n",
              "f.toml:17: key 'simplyfy': unknown; did you mean 'simplify'?"},
        Fault{"nothing_like_it", "", "[entirely_else]\n", "f.toml:17: key 'entirely_else': unknown; remove it"},
        Fault{"double_key", "z_m = 1.73", "z_m = 1.73\nz_m = 1.74", "f.toml:6: not valid TOML"},
        Fault{"double_table", "", "[lidar]\nport = 1\n", "f.toml:17: not valid TOML"},
        Fault{"not_toml", "z_m = 1.73", "z_m 1.73", "f.toml:5: not valid TOML"},
        Fault{"text_for_number", "z_m = 1.73", "z_m = \"1.73\"",
              "f.toml:5: key 'lidar.z_m': is a text; must be a number"},
        Fault{"number_for_text", "\"HDL-64E S2\"", "64",
              "f.toml:2: key 'lidar.model': is a whole number; must be a text"},
        Fault{"fraction_for_whole_number", "z_m = 1.73", "z_m = 1.73\nport = 1.5",
              "f.toml:6: key 'lidar.port': is a number; must be a whole number"},
        Fault{"number_for_flag", "", "[real_time]\nlock_memory = 1\n",
              "f.toml:18: key 'real_time.lock_memory': is a whole number; must be true"},
        Fault{"table_for_number", "z_m = 1.73", "z_m = { a = 1 }",
              "f.toml:5: key 'lidar.z_m': is a table; must be a number"},
        Fault{"number_for_table", "", "[simplify.tolerance_m]\na = 1\n",
              "f.toml:17: key 'simplify.tolerance_m': is a table"},
        Fault{"value_for_table", "[lidar]", "log = 3\n[lidar]", "f.toml:1: key 'log': is not a table"},
        Fault{"list_of_tables", "", "[[log]]\n", "f.toml:17: key 'log': is not a table"},
        Fault{"dot_in_quotes", "", "\"log.level\" = \"info\"\n",
              "f.toml:17: key 'vehicle.log.level': has a dot inside quotes"},
        Fault{"below_range", "z_m = 1.73", "z_m = -1.0", "f.toml:5: key 'lidar.z_m': -1 is out of range; 0 to 10"},
        Fault{"above_range_int", "z_m = 1.73", "z_m = 1.73\nport = 65536",
              "f.toml:6: key 'lidar.port': 65536 is out of range; 1 to 65535"},
        Fault{"beyond_32_bit", "z_m = 1.73", "z_m = 1.73\nport = 4294967297",
              "f.toml:6: key 'lidar.port': 4294967297 is out of range"},
        Fault{"not_a_number", "z_m = 1.73", "z_m = nan", "f.toml:5: key 'lidar.z_m': nan is out of range"},
        Fault{"infinite", "z_m = 1.73", "z_m = inf", "f.toml:5: key 'lidar.z_m': inf is out of range"},
        Fault{"pipeline_range", "", "[simplify]\ntolerance_m = 7\n",
              "f.toml:18: key 'simplify.tolerance_m': 7 is out of range; 0.005 to 1"},
        Fault{"missing_key", "z_m = 1.73\n", "",
              "f.toml:1: key 'lidar.z_m': missing; add it: height above the road; for example z_m = 1.73"},
        Fault{"unknown_model", "HDL-64E S2", "HDL-64",
              "f.toml:2: key 'lidar.model': \"HDL-64\" is not known; one of \"HDL-64E S2\""},
        Fault{"unknown_choice", "z_m = 1.73", "z_m = 1.73\nclock = \"gps\"",
              "key 'lidar.clock': \"gps\" is not known; one of \"arrival\", \"device\""},
        Fault{"bad_address", "z_m = 1.73", "z_m = 1.73\nsource_address = \"1.2.3\"",
              "f.toml:6: key 'lidar.source_address': \"1.2.3\" is not an IPv4"},
        Fault{"missing_file", "vehicle.dbc", "none.dbc", "f.toml:14: key 'vehicle.dbc': cannot read '"},
        Fault{"long_interface", "can0", "a_very_long_interface",
              "f.toml:13: key 'vehicle.can': \"a_very_long_interface\" is too long"},
        Fault{"control_character", "can0", "can\\u0000", "f.toml:13: key 'vehicle.can': holds a control character"},
        Fault{"valid_raw_of_nothing", "\"SteeringSensor.SteeringWheelAngle\"", "{ sum = [\"A.B\"], valid_raw = 1 }",
              "key 'vehicle.steering_signal': has 'valid_raw' without 'valid'"},
        Fault{"negative_raw", "\"SteeringSensor.SteeringWheelAngle\"", "{ sum = [\"A.B\"], invalid_raw = -1 }",
              "'invalid_raw' must be a whole number from 0"},
        Fault{"unknown_kind", "", "messages = [{ message = \"A\", kind = \"crc\" }]\n",
              "key 'vehicle.messages': kind \"crc\" is not known; one of \"toyota\", \"honda\""},
        Fault{"message_without_name", "", "messages = [{ timeout_ms = 50 }]\n", "lacks 'message'"},
        Fault{"message_time_out", "", "messages = [{ message = \"A\", timeout_ms = 0 }]\n", "1 to 60000"},
        Fault{"message_key", "", "messages = [{ message = \"A\", time = 1 }]\n", "'time' is not part of a message"},
        Fault{"message_text", "", "messages = [\"A\"]\n", "holds a text; must hold tables"},
        Fault{"drive_only", "z_m = 1.73", "z_m = 1.73\npcap = \"lidar.pcap\"",
              "f.toml:6: key 'lidar.pcap': belongs into the drive.toml"},
        Fault{"no_signal_name", "SteeringSensor.SteeringWheelAngle", "Steering",
              "f.toml:15: key 'vehicle.steering_signal': \"Steering\" does not name"},
        Fault{"five_wheels", "\"W.RR\"", "\"W.RR\", \"W.X\"",
              "f.toml:16: key 'vehicle.wheel_speed_signals': has 5 signals; 4: front left"},
        Fault{"no_wheels", "[\"W.FL\", \"W.FR\", \"W.RL\", \"W.RR\"]", "[]",
              "f.toml:16: key 'vehicle.wheel_speed_signals': names no signal and there is no [imu]"},
        Fault{"wheel_without_name", "W.RR", "", "f.toml:16: key 'vehicle.wheel_speed_signals': holds an empty name"},
        Fault{"signal_part", "\"W.RR\"", "{ sum = [\"A.B\"], factor = 2 }",
              "f.toml:16: key 'vehicle.wheel_speed_signals': 'factor' is not part"},
        Fault{"signal_scale", "\"W.RR\"", "{ sum = [\"A.B\"], scale = 0 }",
              "f.toml:16: key 'vehicle.wheel_speed_signals': 'scale' must be"},
        Fault{"signal_sum", "\"W.RR\"", "{ sum = \"A.B\" }",
              "f.toml:16: key 'vehicle.wheel_speed_signals': 'sum' is a text; must be a list"},
        Fault{"signal_without_sum", "\"W.RR\"", "{ scale = 2.0 }",
              "f.toml:16: key 'vehicle.wheel_speed_signals': lacks 'sum'"},
        Fault{"imu_without_device", "", "[imu]\nprotocol = \"xsens\"\nroll_deg = 0\npitch_deg = 0\nyaw_deg = 0\n",
              "f.toml:17: key 'imu.device': missing; name the serial line"},
        Fault{"imu_without_signals", "", "[imu]\nprotocol = \"can\"\nroll_deg = 0\npitch_deg = 0\nyaw_deg = 0\n",
              "f.toml:17: key 'imu.rate_z_signal': protocol \"can\" needs it"}),
    [](const auto& fault) { return std::string(fault.param.name); });

TEST_F(Config, all_errors_of_a_file_come_together_in_its_order) {
  const auto settings = parse("[lidar]\nmodell = \"VLP-16\"\nz_m = 70\n");
  ASSERT_FALSE(settings);
  const std::string& message = settings.error().message;
  EXPECT_THAT(message, HasSubstr("f.toml:1: key 'lidar.model': missing"));
  EXPECT_THAT(message, HasSubstr("\nf.toml:2: key 'lidar.modell': unknown; did you mean 'lidar.model'?"));
  EXPECT_THAT(message, HasSubstr("\nf.toml:3: key 'lidar.z_m': 70 is out of range"));
  EXPECT_THAT(message, HasSubstr("key 'vehicle': neither [vehicle] nor [imu] is there"));
  EXPECT_LT(message.find(":2: "), message.find(":3: "));
}

TEST_F(Config, an_empty_file_lacks_its_tables) {
  const auto settings = parse("");
  ASSERT_FALSE(settings);
  EXPECT_THAT(settings.error().message, HasSubstr("f.toml:1: key 'lidar': the table is missing; add [lidar]"));
  EXPECT_THAT(settings.error().message, HasSubstr("f.toml:1: key 'vehicle': neither"));
}

TEST_F(Config, a_drive_refuses_what_belongs_elsewhere_or_is_not_there) {
  EXPECT_THAT(parse(kDrive + "[simplify]\ntolerance_m = 0.1\n", ConfigContext::drive).error().message,
              HasSubstr("key 'simplify.tolerance_m': does not belong into a drive"));
  EXPECT_THAT(parse(kDrive + "[imus]\n", ConfigContext::drive).error().message, HasSubstr("did you mean 'imu'?"));
  fs::remove(folder_ / "can.log");
  fs::remove(folder_ / "lidar.pcap");
  const std::string message = parse(kDrive, ConfigContext::drive).error().message;
  EXPECT_THAT(message, HasSubstr("f.toml:5: key 'lidar.pcap': cannot read '" + (folder_ / "lidar.pcap").native()));
  EXPECT_THAT(message, HasSubstr("f.toml:18: key 'vehicle.can': cannot read"));
}

TEST_F(Config, files_that_cannot_be_read_are_named) {
  EXPECT_THAT(load_settings(folder_ / "none.toml").error().message, HasSubstr("none.toml: cannot read: No such file"));
  EXPECT_THAT(load_settings(folder_).error().message, HasSubstr("cannot read: Is a directory"));
  EXPECT_THAT(load_drive(folder_).error().message, HasSubstr("drive.toml: cannot read: No such file"));
  write("drive.toml", kDrive);
  EXPECT_THAT(load_drive(folder_, folder_ / "none.toml").error().message, HasSubstr("none.toml: cannot read"));
  write("large.toml", std::string(2 << 20, '#'));
  EXPECT_THAT(load_settings(folder_ / "large.toml").error().message, HasSubstr("larger than 1 MiB"));
}

TEST_F(Config, errors_in_the_configuration_that_goes_with_a_drive_are_found) {
  write("drive.toml", kDrive);
  write("steps.toml", "[simplify]\ntolerance = 0.2\n");
  EXPECT_THAT(load_drive(folder_, folder_ / "steps.toml").error().message,
              HasSubstr("steps.toml:2: key 'simplify.tolerance': unknown; did you mean 'simplify.tolerance_m'?"));
}

}  // namespace
}  // namespace roadvec
