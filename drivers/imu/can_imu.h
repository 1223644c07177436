#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "core/base/error.h"
#include "drivers/can/motion_decoder.h"
#include "drivers/imu/vehicle_axes.h"

namespace roadvec {

/// What the bus calls the readings of an inertial sensor. Units: rad/s, deg/s; m/s2, g; rad, deg. No names: not sent.
struct ImuSignals {
  std::array<SignalExpression, 3> rate, acceleration;  ///< about and along the sensor's x, y, z
  SignalExpression roll, pitch;
  SignalExpression heading;  ///< clockwise from north, as navigation has it
};

/// Turns frames into inertial samples. A sample comes with each frame that brings the last reading of a kind that is
/// sent (the rate about z, the acceleration along z, the heading; failing that, the one before it); the others of the
/// kind are as they came last, and what is not sent is 0. No allocation, no exceptions once made.
class ImuCanDecoder {
 public:
  /// The error names the signal and what is wrong with it.
  [[nodiscard]] static Expected<ImuCanDecoder> create(const DbcFile& dbc, const ImuSignals& signals,
                                                      const Mounting& mounting);

  /// Error and remote frames and other messages give nothing. Valid until the next call.
  [[nodiscard]] std::span<const MotionSample> decode(const CanFrame& frame) noexcept;

  [[nodiscard]] std::span<const CanId> ids() const noexcept { return ids_; }  ///< for the reader's filter
  [[nodiscard]] MotionCounters counters() const noexcept;

 private:
  enum Kind : std::uint8_t { kRate, kAcceleration, kOrientation };
  /// One reading: a decoder whose only quantity it is, as an angle in radians, whatever it means.
  struct Reading {
    Kind kind;
    std::size_t axis;
    bool completes;  ///< its kind
    MotionDecoder decoder;
    double value = 0;
  };
  explicit ImuCanDecoder(const Mounting& mounting) : to_vehicle_(mounting) {}
  [[nodiscard]] Expected<void> add(const DbcFile& dbc, SignalExpression expression, Kind kind, std::size_t axis);
  [[nodiscard]] Eigen::Vector3d values(Kind kind) const noexcept;

  SensorToVehicle to_vehicle_;
  std::vector<Reading> readings_;
  std::vector<CanId> ids_;
  MotionSample sample_;
};

}  // namespace roadvec
