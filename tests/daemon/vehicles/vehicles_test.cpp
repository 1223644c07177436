// The cars of config/vehicles, each as a user pastes it, on frames made by hand.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <variant>
#include <vector>

#include "core/base/angle.h"
#include "daemon/config/load.h"
#include "daemon/sensors.h"

namespace roadvec {
namespace {

namespace fs = std::filesystem;

constexpr const char* kRest =
    "[lidar]\nmodel = \"VLP-16\"\nx_m = 0.0\ny_m = 0.0\nz_m = 1.8\nroll_deg = 0.0\npitch_deg = 0.0\nyaw_deg = 0.0\n"
    "[anchor]\nlatitude_deg = 49.0\nlongitude_deg = 8.4\nheight_m = 112.0\nyaw_deg = 0.0\n";

struct Car {
  const char* name;
  std::vector<std::string> frames;  ///< one for the steering wheel, one for the wheels
  double steering_deg;
  std::vector<double> wheels_mps;  ///< front left, front right, rear left, rear right
  std::string bad_frame;           ///< "": nothing that this car tells shows that a frame is bad
};

class Vehicles : public testing::TestWithParam<Car> {
 protected:
  void SetUp() override {
    fs::create_directory(folder_);
    fs::create_directory_symlink(fs::path(ROADVEC_SOURCE) / "config/vehicles", folder_ / "vehicles");
  }
  void TearDown() override { fs::remove_all(folder_); }

  Expected<Settings> settings() {
    std::ostringstream table;
    table << std::ifstream(folder_ / "vehicles" / (std::string(GetParam().name) + ".toml")).rdbuf();
    std::ofstream(folder_ / "car.toml") << kRest << table.str();
    return load_settings(folder_ / "car.toml");
  }
  /// What the frames give, ten milliseconds apart; and what was counted.
  std::vector<MotionSample> samples_of(const std::vector<std::string>& frames, VehicleCounts& counts) {
    Expected<Settings> car = settings();
    EXPECT_TRUE(car) << car.error().message;
    car->vehicle->can = folder_ / "can.log";
    std::ofstream log(folder_ / "can.log");
    int hundredths = 100;
    for (const std::string& frame : frames) {
      log << "(1." << hundredths++ << "000) can0 " << frame << "\n";
    }
    log.close();
    const auto vehicle = open_vehicle(*car, InputKind::recorded);
    EXPECT_TRUE(vehicle) << vehicle.error().message;
    MotionInput& input = *vehicle->inputs.at(0);
    std::vector<MotionSample> samples;
    for (; const MotionSample* sample = input.front(std::chrono::milliseconds(0)); input.take()) {
      samples.push_back(*sample);
    }
    input.count(counts);
    return samples;
  }

  fs::path folder_ = fs::path(testing::TempDir()) / (std::string("roadvec_vehicles_") + GetParam().name);
};

TEST_P(Vehicles, frames_give_the_angle_and_speeds_that_were_put_in) {
  VehicleCounts counts;
  const std::vector<MotionSample> samples = samples_of(GetParam().frames, counts);
  ASSERT_EQ(samples.size(), 2U);
  EXPECT_NEAR(std::get<SteeringAngle>(samples[0].value).wheel_rad, rad_from_deg(GetParam().steering_deg), 1e-9);
  const auto& speed = std::get<WheelSpeed>(samples[1].value);
  const std::vector<double> speeds_mps = {speed.front_left_mps, speed.front_right_mps, speed.rear_left_mps,
                                          speed.rear_right_mps};
  EXPECT_THAT(speeds_mps, testing::Pointwise(testing::DoubleNear(1e-9), GetParam().wheels_mps));
  EXPECT_EQ(counts.motion.messages.bad_checksum_count, 0U);
}

TEST_P(Vehicles, a_frame_that_the_car_itself_calls_bad_gives_nothing) {
  if (GetParam().bad_frame.empty()) return;
  VehicleCounts counts;
  EXPECT_TRUE(samples_of({GetParam().bad_frame}, counts).empty());
  EXPECT_EQ(counts.motion.messages.bad_checksum_count + counts.motion.not_valid_count, 1U);
}

const std::vector<double> kTenToForty_kmh = {10 / 3.6, 20 / 3.6, 30 / 3.6, 40 / 3.6};

INSTANTIATE_TEST_SUITE_P(
    Each, Vehicles,
    testing::Values(
        // -10 * 1.5 deg + 3 * 0.1 deg; raw 6767 is standstill, and right comes before left.
        Car{"toyota", {"025#0FF6000030000000", "0AA#223F1E572A0F2627"}, -14.7, kTenToForty_kmh, ""},
        // 100 * -0.1 deg; nibbles of id and data: 15 + 10, and 8 - 25 = 15 mod 16. Four times 15 bits, then the sum.
        Car{"honda", {"14A#006400000000000F", "1D0#07D01F405DC0FA0B"}, -10, kTenToForty_kmh, "14A#0065000000000000"},
        // Raw -100; checksums by a program of its own.
        Car{"hyundai_canfd",
            {"125##14B9F079CFF0000000000000000000000", "0A0##1669709000000000040018002C00300050000000000000000"},
            10,
            kTenToForty_kmh,
            "125##14B9F089CFF0000000000000000000000"},
        // Raw 100 and the bit that makes it negative; speeds of 4 000 in every wheel are 30 km/h. Bad: the quality bit.
        Car{"volkswagen_mqb",
            {"086#5105642000000000", "0B2#A00FA00FA00FA00F"},
            -10,
            {30 / 3.6, 30 / 3.6, 30 / 3.6, 30 / 3.6},
            "086#D285642000000000"},
        // (16100 - 16000) * 0.1 deg; 1000 * 0.01 rad/s * 0.33 m. Bad: degraded, 2.
        Car{"ford",
            {"07E#00003EE4000C0000", "217#03E807D00BB80FA0"},
            10,
            {3.3, 6.6, 9.9, 13.2},
            "07E#00003EE400080000"},
        // (8292 - 8192) * 0.1 deg to the right.
        Car{"tesla_model3",
            {"370#100000002064030A", "175#FA803EB80BF44126"},
            -10,
            kTenToForty_kmh,
            "370#100000002064040A"}),
    [](const auto& name) { return name.param.name; });

}  // namespace
}  // namespace roadvec
