#include "drivers/imu/can_imu.h"

#include <algorithm>

#include "core/base/angle.h"

namespace roadvec {
namespace {

struct Unit {
  const char* name;
  double si;
};
constexpr double kStandardGravity_mps2 = 9.80665;
constexpr auto kRateUnits = std::to_array<Unit>(
    {{"rad/s", 1}, {"deg/s", kPi / 180}, {"degree/s", kPi / 180}, {"\xB0/s", kPi / 180}, {"\xC2\xB0/s", kPi / 180}});
constexpr auto kAccelerationUnits = std::to_array<Unit>(
    {{"m/s2", 1}, {"m/s^2", 1}, {"m/s/s", 1}, {"m/s\xB2", 1}, {"m/s\xC2\xB2", 1}, {"g", kStandardGravity_mps2}});
constexpr auto kAngleUnits = std::to_array<Unit>({{"rad", 1},
                                                  {"deg", kPi / 180},
                                                  {"degree", kPi / 180},
                                                  {"degrees", kPi / 180},
                                                  {"\xB0", kPi / 180},
                                                  {"\xC2\xB0", kPi / 180}});

Expected<double> factor_of(const DbcFile& dbc, const SignalExpression& expression, std::span<const Unit> units) {
  std::string unit = expression.unit;
  if (unit.empty()) {
    const Expected<DbcSignalRef> found = find_signal(dbc, expression.sum.front());
    if (!found) return tl::unexpected(found.error());
    unit = found->signal->unit;
  }
  std::transform(unit.begin(), unit.end(), unit.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  std::string known;
  for (const Unit& offered : units) {
    if (unit == offered.name) return offered.si;
    if (static_cast<unsigned char>(offered.name[0]) < 0x80)
      known += (known.empty() ? "" : ", ") + std::string(offered.name);
  }
  return fail("signal '" + expression.sum.front() + "': its unit '" + unit + "' does not fit: set the unit, one of " +
              known);
}

}  // namespace

Expected<ImuCanDecoder> ImuCanDecoder::create(const DbcFile& dbc, const ImuSignals& signals, const Mounting& mounting) {
  ImuCanDecoder decoder(mounting);
  const std::array<SignalExpression, 3> angles{signals.roll, signals.pitch, signals.heading};
  for (const auto& [kind, expressions] :
       {std::pair{kRate, &signals.rate}, {kAcceleration, &signals.acceleration}, {kOrientation, &angles}}) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if ((*expressions)[axis].sum.empty()) continue;
      if (auto added = decoder.add(dbc, (*expressions)[axis], kind, axis); !added) return tl::unexpected(added.error());
    }
    if (!decoder.readings_.empty() && decoder.readings_.back().kind == kind) decoder.readings_.back().completes = true;
  }
  if (decoder.readings_.empty()) return fail("no signal of the IMU is named");
  if (signals.heading.sum.empty() && (!signals.roll.sum.empty() || !signals.pitch.sum.empty())) {
    return fail("roll and pitch of the IMU are named without its heading: name all, or leave them out");
  }
  return decoder;
}

Expected<void> ImuCanDecoder::add(const DbcFile& dbc, SignalExpression expression, Kind kind, std::size_t axis) {
  const std::span<const Unit> units = kind == kRate           ? std::span<const Unit>(kRateUnits)
                                      : kind == kAcceleration ? std::span<const Unit>(kAccelerationUnits)
                                                              : std::span<const Unit>(kAngleUnits);
  const Expected<double> factor = factor_of(dbc, expression, units);
  if (!factor) return tl::unexpected(factor.error());
  expression.scale *= *factor;
  expression.unit = "rad";
  VehicleSignals alone;
  alone.steering = std::move(expression);
  Expected<MotionDecoder> decoder = MotionDecoder::create(dbc, alone);
  if (!decoder) return tl::unexpected(decoder.error());
  for (const CanId id : decoder->ids()) {
    if (std::find(ids_.begin(), ids_.end(), id) == ids_.end()) ids_.push_back(id);
  }
  readings_.push_back({.kind = kind, .axis = axis, .completes = false, .decoder = std::move(*decoder)});
  return {};
}

Eigen::Vector3d ImuCanDecoder::values(Kind kind) const noexcept {
  Eigen::Vector3d result = Eigen::Vector3d::Zero();
  for (const Reading& reading : readings_) {
    if (reading.kind == kind) result[static_cast<Eigen::Index>(reading.axis)] = reading.value;
  }
  return result;
}

std::span<const MotionSample> ImuCanDecoder::decode(const CanFrame& frame) noexcept {
  SensorAxesSample axes;
  for (Reading& reading : readings_) {
    const std::span<const MotionSample> decoded = reading.decoder.decode(frame);
    if (decoded.empty()) continue;
    reading.value = std::get<SteeringAngle>(decoded.front().value).wheel_rad;
    if (!reading.completes) continue;
    if (reading.kind == kRate) axes.rate_radps = values(kRate);
    if (reading.kind == kAcceleration) axes.acceleration_mps2 = values(kAcceleration);
    if (reading.kind == kOrientation) {
      const Eigen::Vector3d angles = values(kOrientation);
      axes.R_enu_sensor = rotation_from(angles[0], angles[1], kPi / 2 - angles[2]);
    }
  }
  const std::optional<ImuSample> imu = to_vehicle_.convert(axes);
  if (!imu) return {};
  sample_ = {frame.time, *imu};
  return {&sample_, 1};
}

MotionCounters ImuCanDecoder::counters() const noexcept {
  MotionCounters sum;
  for (const Reading& reading : readings_) {
    sum.short_frame_count += reading.decoder.counters().short_frame_count;
    sum.invalid_value_count += reading.decoder.counters().invalid_value_count;
  }
  return sum;
}

}  // namespace roadvec
