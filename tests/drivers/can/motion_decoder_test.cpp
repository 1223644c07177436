#include "drivers/can/motion_decoder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <string>
#include <variant>
#include <vector>

#include "core/base/angle.h"
#include "drivers/can/can_log_reader.h"
#include "tests/support/recordings.h"

namespace roadvec {
namespace {

using testing::HasSubstr;

constexpr const char* kCar =
    "BO_ 1 Steer: 4 X\n"
    " SG_ Coarse : 0|8@1- (1.5,0) [0|1] \"deg\" X\n"
    " SG_ Fine : 8|4@1- (0.1,0) [0|1] \"deg\" X\n"
    " SG_ Right : 12|1@1+ (1,0) [0|1] \"\" X\n"
    " SG_ Radians : 16|8@1- (0.01,0) [0|1] \"rad\" X\n"
    "BO_ 2 Front: 2 X\n"
    " SG_ FL : 0|8@1+ (3.6,0) [0|1] \"km/h\" X\n"
    " SG_ FR : 8|8@1+ (3.6,0) [0|1] \"kph\" X\n"
    "BO_ 2147483651 Rear: 4 X\n"
    " SG_ RL : 0|8@1+ (1,0) [0|1] \"m/s\" X\n"
    " SG_ RR : 8|8@1+ (1,0) [0|1] \"mph\" X\n"
    " SG_ Rate : 16|8@1+ (1,0) [0|1] \"rad/s\" X\n"
    " SG_ Turns : 24|8@1+ (1,0) [0|1] \"RPM\" X\n";

const DbcFile& car() {
  static const DbcFile file = parse_dbc(kCar, "car.dbc");
  return file;
}

SignalExpression of(const std::string& name) {
  SignalExpression expression;
  expression.sum = {name};
  return expression;
}

CanFrame frame_of(CanId id, std::int64_t ns, std::initializer_list<unsigned> bytes) {
  CanFrame frame;
  frame.id = id.id;
  frame.extended = id.extended;
  frame.time = {ns};
  for (const unsigned byte : bytes) frame.data[frame.length++] = static_cast<std::uint8_t>(byte);
  return frame;
}

constexpr CanId kSteer{1, false};
constexpr CanId kFront{2, false};
constexpr CanId kRear{3, true};

MotionDecoder decoder_of(const VehicleSignals& signals) {
  Expected<MotionDecoder> decoder = MotionDecoder::create(car(), signals);
  if (!decoder) throw std::runtime_error(decoder.error().message);
  return *decoder;
}

std::string error_of(const VehicleSignals& signals) {
  const Expected<MotionDecoder> decoder = MotionDecoder::create(car(), signals);
  return decoder ? "no error" : decoder.error().message;
}

double steering(const SignalExpression& expression, const CanFrame& frame) {
  MotionDecoder decoder = decoder_of({.steering = expression, .wheel_speeds = {}, .messages = {}});
  const auto samples = decoder.decode(frame);
  EXPECT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].time, frame.time);
  return std::get<SteeringAngle>(samples[0].value).wheel_rad;
}

WheelSpeed wheel_speed(const std::span<const MotionSample>& samples) {
  EXPECT_EQ(samples.size(), 1U);
  return std::get<WheelSpeed>(samples[0].value);
}

TEST(MotionDecoder, the_steering_angle_is_a_sum_in_radians) {
  SignalExpression sum = of("Steer.Coarse");
  sum.sum.push_back("Steer.Fine");
  EXPECT_DOUBLE_EQ(steering(sum, frame_of(kSteer, 5, {10, 0x0F, 0, 0})), rad_from_deg(14.9));
}

TEST(MotionDecoder, a_sign_signal_and_a_scale_turn_the_direction) {
  SignalExpression signed_angle = of("Steer.Coarse");
  signed_angle.sign = "Steer.Right";
  EXPECT_DOUBLE_EQ(steering(signed_angle, frame_of(kSteer, 0, {10, 0x00, 0, 0})), rad_from_deg(15));
  EXPECT_DOUBLE_EQ(steering(signed_angle, frame_of(kSteer, 0, {10, 0x10, 0, 0})), rad_from_deg(-15));
  signed_angle.scale = -1.0;
  EXPECT_DOUBLE_EQ(steering(signed_angle, frame_of(kSteer, 0, {10, 0x10, 0, 0})), rad_from_deg(15));
}

TEST(MotionDecoder, radians_stay_and_a_configured_unit_overrides_the_files) {
  EXPECT_DOUBLE_EQ(steering(of("Steer.Radians"), frame_of(kSteer, 0, {0, 0, 50, 0})), 0.5);
  SignalExpression turned = of("Steer.Right");
  turned.unit = "deg";
  EXPECT_DOUBLE_EQ(steering(turned, frame_of(kSteer, 0, {0, 0x10, 0, 0})), rad_from_deg(1));
}

TEST(MotionDecoder, wheel_speeds_of_several_messages_become_one_sample_when_all_have_come_anew) {
  MotionDecoder decoder = decoder_of(
      {.steering = {}, .wheel_speeds = {of("Front.FL"), of("Front.FR"), of("Rear.RL"), of("Rear.RR")}, .messages = {}});
  EXPECT_THAT(decoder.ids(), testing::ElementsAre(kFront, kRear));
  EXPECT_TRUE(decoder.decode(frame_of(kFront, 10, {5, 6})).empty());
  EXPECT_TRUE(decoder.decode(frame_of(kFront, 20, {7, 8})).empty());
  const auto samples = decoder.decode(frame_of(kRear, 25, {9, 10, 0, 0}));
  const WheelSpeed speed = wheel_speed(samples);
  EXPECT_EQ(samples[0].time.ns, 25);
  EXPECT_DOUBLE_EQ(speed.front_left_mps, 7.0);
  EXPECT_DOUBLE_EQ(speed.front_right_mps, 8.0);
  EXPECT_DOUBLE_EQ(speed.rear_left_mps, 9.0);
  EXPECT_DOUBLE_EQ(speed.rear_right_mps, 4.4704);
  EXPECT_TRUE(decoder.decode(frame_of(kRear, 35, {9, 10, 0, 0})).empty());
  EXPECT_EQ(decoder.counters().wheel_speed_count, 1U);
}

TEST(MotionDecoder, fewer_wheel_speeds_are_repeated) {
  MotionDecoder one = decoder_of({.steering = {}, .wheel_speeds = {of("Rear.RL")}, .messages = {}});
  EXPECT_DOUBLE_EQ(wheel_speed(one.decode(frame_of(kRear, 0, {9, 0, 0, 0}))).front_right_mps, 9.0);
  MotionDecoder two = decoder_of({.steering = {}, .wheel_speeds = {of("Front.FL"), of("Front.FR")}, .messages = {}});
  const WheelSpeed axle = wheel_speed(two.decode(frame_of(kFront, 0, {5, 6})));
  EXPECT_DOUBLE_EQ(axle.rear_left_mps, 5.0);
  EXPECT_DOUBLE_EQ(axle.rear_right_mps, 6.0);
}

TEST(MotionDecoder, turning_rates_become_speeds_by_the_wheel_radius) {
  VehicleSignals signals{
      .steering = {}, .wheel_speeds = {of("Rear.Rate"), of("Rear.Turns")}, .wheel_radius_m = 0.3, .messages = {}};
  MotionDecoder decoder = decoder_of(signals);
  const WheelSpeed speed = wheel_speed(decoder.decode(frame_of(kRear, 0, {0, 0, 10, 60})));
  EXPECT_DOUBLE_EQ(speed.front_left_mps, 3.0);
  EXPECT_DOUBLE_EQ(speed.front_right_mps, 0.3 * kTwoPi);
  signals.wheel_radius_m = 0.0;
  EXPECT_THAT(error_of(signals), HasSubstr("wheel_radius_m"));
}

TEST(MotionDecoder, one_message_may_give_both_kinds_of_sample) {
  SignalExpression speed = of("Steer.Right");
  speed.unit = "m/s";
  MotionDecoder decoder = decoder_of({.steering = of("Steer.Coarse"), .wheel_speeds = {speed}, .messages = {}});
  EXPECT_EQ(decoder.decode(frame_of(kSteer, 0, {1, 0x10, 0, 0})).size(), 2U);
}

TEST(MotionDecoder, short_frames_are_counted_and_other_frames_ignored) {
  MotionDecoder decoder = decoder_of({.steering = of("Steer.Radians"), .wheel_speeds = {}, .messages = {}});
  EXPECT_TRUE(decoder.decode(frame_of(kSteer, 0, {1, 2})).empty());
  EXPECT_EQ(decoder.counters().short_frame_count, 1U);
  CanFrame frame = frame_of(kSteer, 0, {0, 0, 1, 0});
  frame.remote = true;
  EXPECT_TRUE(decoder.decode(frame).empty());
  frame.remote = false;
  frame.error = true;
  EXPECT_TRUE(decoder.decode(frame).empty());
  EXPECT_TRUE(decoder.decode(frame_of({1, true}, 0, {0, 0, 1, 0})).empty());
  EXPECT_EQ(decoder.counters().short_frame_count, 1U);
  EXPECT_EQ(decoder.counters().steering_count, 0U);
}

TEST(MotionDecoder, a_value_is_used_while_its_validity_signal_says_so) {
  VehicleSignals signals;
  signals.steering = of("Steer.Coarse");
  signals.steering.valid = "Steer.Right";
  MotionDecoder decoder = decoder_of(signals);
  EXPECT_TRUE(decoder.decode(frame_of(kSteer, 0, {10, 0x00, 0, 0})).empty());
  EXPECT_EQ(decoder.decode(frame_of(kSteer, 0, {10, 0x10, 0, 0})).size(), 1U);
  EXPECT_EQ(decoder.counters().not_valid_count, 1U);

  signals.steering.valid_raw = 0;  // a quality bit that is set when the value is bad
  MotionDecoder inverse = decoder_of(signals);
  EXPECT_EQ(inverse.decode(frame_of(kSteer, 0, {10, 0x00, 0, 0})).size(), 1U);
  EXPECT_TRUE(inverse.decode(frame_of(kSteer, 0, {10, 0x10, 0, 0})).empty());
  EXPECT_TRUE(inverse.decode(frame_of(kSteer, 0, {10})).empty());
  EXPECT_EQ(inverse.counters().not_valid_count, 1U);
  EXPECT_EQ(inverse.counters().short_frame_count, 1U);

  signals.steering.valid = "Front.FL";
  EXPECT_THAT(error_of(signals), HasSubstr("valid: signal 'Front.FL' is of another message"));
}

TEST(MotionDecoder, a_raw_value_that_stands_for_none_gives_no_sample) {
  VehicleSignals signals;
  signals.wheel_speeds = {of("Front.FL"), of("Front.FR")};
  signals.wheel_speeds[1].invalid_raw = 0xFF;
  MotionDecoder decoder = decoder_of(signals);
  EXPECT_TRUE(decoder.decode(frame_of(kFront, 0, {0xFF, 0xFF})).empty());
  EXPECT_EQ(decoder.decode(frame_of(kFront, 0, {0xFF, 0xFE})).size(), 1U);
  EXPECT_EQ(decoder.counters().invalid_value_count, 1U);
}

TEST(MotionDecoder, what_a_silent_message_said_last_is_not_put_beside_new_values) {
  VehicleSignals signals;
  signals.wheel_speeds = {of("Front.FL"), of("Front.FR"), of("Rear.RL"), of("Rear.RR")};
  signals.messages.emplace_back().message = "Front";
  signals.messages[0].timeout_s = 0.1;
  MotionDecoder decoder = decoder_of(signals);
  EXPECT_TRUE(decoder.decode(frame_of(kFront, 0, {5, 6})).empty());
  EXPECT_TRUE(decoder.decode(frame_of(kRear, 100'000'001, {7, 8, 0, 0})).empty());
  EXPECT_EQ(decoder.counters().messages.timeout_count, 1U);
  EXPECT_TRUE(decoder.decode(frame_of(kRear, 200'000'002, {7, 8, 0, 0})).empty());
  EXPECT_EQ(decoder.counters().messages.timeout_count, 1U) << "told once";
  EXPECT_EQ(decoder.decode(frame_of(kFront, 200'000'003, {5, 6})).size(), 1U);
}

TEST(MotionDecoder, five_cycle_times_of_the_file_are_a_time_out_unless_another_is_set) {
  const DbcFile file = parse_dbc(std::string(kCar) + "BA_ \"GenMsgCycleTime\" BO_ 1 10;\n", "car.dbc");
  VehicleSignals signals;
  signals.steering = of("Steer.Coarse");
  signals.wheel_speeds = {of("Front.FL")};
  MotionDecoder decoder = *MotionDecoder::create(file, signals);
  EXPECT_EQ(decoder.decode(frame_of(kSteer, 0, {1, 0, 0, 0})).size(), 1U);
  EXPECT_EQ(decoder.decode(frame_of(kFront, 50'000'000, {5, 6})).size(), 1U);
  EXPECT_EQ(decoder.counters().messages.timeout_count, 0U);
  EXPECT_EQ(decoder.decode(frame_of(kFront, 50'000'001, {5, 6})).size(), 1U);
  EXPECT_EQ(decoder.counters().messages.timeout_count, 1U);
}

TEST(MotionDecoder, what_cannot_be_decoded_is_refused_with_the_reason) {
  EXPECT_THAT(error_of({.steering = of("Steer.Corse"), .wheel_speeds = {}, .messages = {}}),
              HasSubstr("near it: Coarse"));
  EXPECT_THAT(error_of({.steering = of("Ster.Coarse"), .wheel_speeds = {}, .messages = {}}),
              HasSubstr("near it: Steer"));
  EXPECT_THAT(error_of({.steering = of("Steer.Right"), .wheel_speeds = {}, .messages = {}}), HasSubstr("deg or rad"));
  EXPECT_THAT(error_of({.steering = {}, .wheel_speeds = {of("Steer.Coarse")}, .messages = {}}), HasSubstr("km/h"));
  EXPECT_THAT(error_of({.steering = {}, .wheel_speeds = {}, .messages = {}}), HasSubstr("neither"));
  EXPECT_THAT(
      error_of({.steering = {}, .wheel_speeds = std::vector<SignalExpression>(5, of("Front.FL")), .messages = {}}),
      HasSubstr("more than four"));
  SignalExpression two_messages = of("Steer.Coarse");
  two_messages.sum.push_back("Front.FL");
  two_messages.unit = "deg";
  EXPECT_THAT(error_of({.steering = two_messages, .wheel_speeds = {}, .messages = {}}), HasSubstr("one message"));
  SignalExpression two_units = of("Steer.Coarse");
  two_units.sum.push_back("Steer.Radians");
  EXPECT_THAT(error_of({.steering = two_units, .wheel_speeds = {}, .messages = {}}), HasSubstr("one unit"));
  SignalExpression far_sign = of("Steer.Coarse");
  far_sign.sign = "Front.FL";
  EXPECT_THAT(error_of({.steering = far_sign, .wheel_speeds = {}, .messages = {}}), HasSubstr("another message"));
}

/// A row as the reference was written: seconds with six decimals, values with six decimals.
std::string row_of(SensorTime time, std::initializer_list<double> values) {
  std::string row = std::to_string(time.ns / 1'000'000'000) + ".";
  const std::string micros = std::to_string(time.ns % 1'000'000'000 / 1000);
  row += std::string(6 - micros.size(), '0') + micros;
  for (const double value : values) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), ",%.6f", value);
    row += text.data();
  }
  return row;
}

std::vector<std::string> rows_of(const std::string& path) {
  std::ifstream stream(path);
  std::vector<std::string> rows;
  std::string row;
  std::getline(stream, row);  // names of the columns
  while (std::getline(stream, row)) rows.push_back(row);
  return rows;
}

TEST(MotionRecordings, a_minute_of_a_toyota_gives_every_row_of_the_reference_to_its_last_digit) {
  const auto log = recording("comma2k19/can.log");
  if (!log) return;
  const Expected<DbcFile> dbc = load_dbc(*recording("comma2k19/toyota_rav4_2017_pt_generated.dbc"));
  ASSERT_TRUE(dbc);
  EXPECT_TRUE(dbc->diagnostics.empty());
  VehicleSignals signals;
  signals.steering.sum = {"STEER_ANGLE_SENSOR.STEER_ANGLE", "STEER_ANGLE_SENSOR.STEER_FRACTION"};
  for (const char* wheel : {"FL", "FR", "RL", "RR"}) {
    signals.wheel_speeds.push_back(of(std::string("WHEEL_SPEEDS.WHEEL_SPEED_") + wheel));
  }
  Expected<MotionDecoder> decoder = MotionDecoder::create(*dbc, signals);
  ASSERT_TRUE(decoder) << decoder.error().message;
  auto reader = CanLogReader::open(*log, "can0");
  ASSERT_TRUE(reader) << reader.error().message;
  std::vector<std::string> steering_rows;
  std::vector<std::string> wheel_rows;
  CanFrame frame;
  while ((*reader)->read(frame, {}) == CanReadResult::frame) {
    for (const MotionSample& sample : decoder->decode(frame)) {
      if (const auto* angle = std::get_if<SteeringAngle>(&sample.value)) {
        steering_rows.push_back(row_of(sample.time, {deg_from_rad(angle->wheel_rad)}));
      } else if (const auto* speed = std::get_if<WheelSpeed>(&sample.value)) {
        wheel_rows.push_back(row_of(
            sample.time, {speed->front_left_mps, speed->front_right_mps, speed->rear_left_mps, speed->rear_right_mps}));
      }
    }
  }
  EXPECT_EQ((*reader)->counters().bad_line_count, 0U);
  EXPECT_EQ(steering_rows.size(), 4974U);
  EXPECT_EQ(wheel_rows.size(), 4974U);
  EXPECT_EQ(steering_rows, rows_of(*recording("comma2k19/steering_angle_deg.csv")));
  EXPECT_EQ(wheel_rows, rows_of(*recording("comma2k19/wheel_speed_mps.csv")));
}

}  // namespace
}  // namespace roadvec
