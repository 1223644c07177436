#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>

namespace roadvec {

/// What an IMU feels at one instant, in its own frame.
struct ImuReading {
  Eigen::Quaterniond orientation;
  Eigen::Vector3d force_mps2, rate_radps;
};

/// The MTData2 message of the `tick`th hundredth of a second, in hex: counter, time, orientation, acceleration, rate of
/// turn and a status that says the filter works.
[[nodiscard]] std::string xsens_message(std::uint64_t tick, const ImuReading& reading);

}  // namespace roadvec
