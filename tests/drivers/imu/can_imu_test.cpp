#include "drivers/imu/can_imu.h"

#include <gmock/gmock.h>

#include "core/base/angle.h"

namespace roadvec {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr const char* kDbc = R"(
BO_ 256 Rates: 8 IMU
 SG_ RateX : 0|16@1- (0.01,0) [0|0] "deg/s" CAR
 SG_ RateY : 16|16@1- (0.01,0) [0|0] "deg/s" CAR
 SG_ RateZ : 32|16@1- (0.001,0) [0|0] "rad/s" CAR
BO_ 257 Accelerations: 8 IMU
 SG_ AccX : 0|16@1- (0.001,0) [0|0] "g" CAR
 SG_ AccY : 16|16@1- (0.01,0) [0|0] "m/s^2" CAR
BO_ 258 AccelerationUp: 2 IMU
 SG_ AccZ : 0|16@1- (0.01,0) [0|0] "m/s2" CAR
BO_ 259 Angles: 8 IMU
 SG_ Roll : 0|16@1- (0.01,0) [0|0] "deg" CAR
 SG_ Pitch : 16|16@1- (0.01,0) [0|0] "deg" CAR
 SG_ Heading : 32|16@1+ (0.01,0) [0|0] "deg" CAR
 SG_ Speed : 48|16@1+ (0.01,0) [0|0] "km/h" CAR
)";

SignalExpression signal(const std::string& name, double scale = 1) {
  SignalExpression expression;
  if (!name.empty()) expression.sum = {name};
  expression.scale = scale;
  return expression;
}

ImuSignals all_signals() {
  ImuSignals signals;
  signals.rate = {signal("Rates.RateX"), signal("Rates.RateY"), signal("Rates.RateZ")};
  signals.acceleration = {signal("Accelerations.AccX"), signal("Accelerations.AccY"), signal("AccelerationUp.AccZ")};
  signals.roll = signal("Angles.Roll");
  signals.pitch = signal("Angles.Pitch");
  signals.heading = signal("Angles.Heading");
  return signals;
}

CanFrame frame(std::uint32_t id, std::initializer_list<int> words, std::int64_t time_ns = 0) {
  CanFrame result;
  result.id = id;
  result.time = {time_ns};
  for (const int word : words) {
    result.data[result.length++] = static_cast<std::uint8_t>(word);
    result.data[result.length++] = static_cast<std::uint8_t>(word >> 8);
  }
  return result;
}

ImuCanDecoder decoder_for(const ImuSignals& signals, const Mounting& mounting = {}) {
  auto decoder = ImuCanDecoder::create(parse_dbc(kDbc, "imu.dbc"), signals, mounting);
  EXPECT_TRUE(decoder) << decoder.error().message;
  return std::move(*decoder);
}

TEST(ImuCanDecoder, readings_of_several_messages_and_units_become_si_in_the_vehicle) {
  ImuCanDecoder decoder = decoder_for(all_signals());
  const auto rates = decoder.decode(frame(256, {1000, -500, 250}, 7));
  ASSERT_EQ(rates.size(), 1U);
  EXPECT_EQ(rates[0].time.ns, 7);
  const ImuSample rate = std::get<ImuSample>(rates[0].value);
  EXPECT_TRUE(rate.has_rate && !rate.has_acceleration && !rate.has_orientation);
  EXPECT_NEAR(rate.rate_x_radps, rad_from_deg(10), 1e-12);
  EXPECT_NEAR(rate.rate_y_radps, rad_from_deg(-5), 1e-12);
  EXPECT_NEAR(rate.rate_z_radps, 0.25, 1e-12);

  EXPECT_TRUE(decoder.decode(frame(257, {100, 50})).empty()) << "the third axis comes in another message";
  const auto accelerations = decoder.decode(frame(258, {981}));
  ASSERT_EQ(accelerations.size(), 1U);
  const ImuSample acceleration = std::get<ImuSample>(accelerations[0].value);
  EXPECT_NEAR(acceleration.acceleration_x_mps2, 0.980665, 1e-9);
  EXPECT_NEAR(acceleration.acceleration_y_mps2, 0.5, 1e-9);
  EXPECT_NEAR(acceleration.acceleration_z_mps2, 9.81, 1e-9);

  const auto angles = decoder.decode(frame(259, {100, -200, 3000, 0}));
  ASSERT_EQ(angles.size(), 1U);
  const ImuSample angle = std::get<ImuSample>(angles[0].value);
  EXPECT_NEAR(angle.roll_rad, rad_from_deg(1), 1e-9);
  EXPECT_NEAR(angle.pitch_rad, rad_from_deg(-2), 1e-9);
  EXPECT_NEAR(angle.heading_rad, rad_from_deg(60), 1e-9) << "30 degrees from north, clockwise";
}

TEST(ImuCanDecoder, a_yaw_rate_alone_is_enough_and_its_sign_can_be_turned) {
  ImuSignals signals;
  signals.rate[2] = signal("Rates.RateZ", -1);
  ImuCanDecoder decoder = decoder_for(signals);
  const auto samples = decoder.decode(frame(256, {1000, -500, 250}));
  ASSERT_EQ(samples.size(), 1U);
  const ImuSample imu = std::get<ImuSample>(samples[0].value);
  EXPECT_NEAR(imu.rate_z_radps, -0.25, 1e-12);
  EXPECT_EQ(imu.rate_x_radps, 0);
  EXPECT_THAT(decoder.ids(), testing::ElementsAre(CanId{256, false}));
}

TEST(ImuCanDecoder, a_mounting_is_undone) {
  ImuCanDecoder decoder = decoder_for(all_signals(), {.roll_rad = kPi});  // upside down
  const auto samples = decoder.decode(frame(256, {0, 0, 250}));
  EXPECT_NEAR(std::get<ImuSample>(samples[0].value).rate_z_radps, -0.25, 1e-12);
}

TEST(ImuCanDecoder, frames_that_are_short_foreign_or_errors_give_nothing) {
  ImuCanDecoder decoder = decoder_for(all_signals());
  EXPECT_TRUE(decoder.decode(frame(300, {1, 2, 3, 4})).empty());
  EXPECT_TRUE(decoder.decode(frame(256, {1, 2})).empty());
  EXPECT_EQ(decoder.counters().short_frame_count, 1U);
  CanFrame error = frame(256, {1, 2, 3});
  error.error = true;
  EXPECT_TRUE(decoder.decode(error).empty());
}

TEST(ImuCanDecoder, what_is_named_wrongly_is_said) {
  const auto error_of = [](const ImuSignals& signals) {
    return ImuCanDecoder::create(parse_dbc(kDbc, "imu.dbc"), signals, {}).error().message;
  };
  ImuSignals signals;
  EXPECT_THAT(error_of(signals), HasSubstr("no signal"));
  signals.rate[2] = signal("Angles.Speed");
  EXPECT_THAT(error_of(signals), AllOf(HasSubstr("Angles.Speed"), HasSubstr("km/h"), HasSubstr("rad/s, deg/s")));
  signals.rate[2] = signal("Rates.RateQ");
  EXPECT_THAT(error_of(signals), HasSubstr("RateQ"));
  signals.rate[2] = signal("Rates.RateZ");
  signals.roll = signal("Angles.Roll");
  EXPECT_THAT(error_of(signals), HasSubstr("heading"));
}

}  // namespace
}  // namespace roadvec
