#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/base/error.h"

namespace roadvec {

/// One thing a device sends, and how often; 65535: with every message.
struct XsensOutput {
  std::uint16_t data_id = 0, rate_hz = 0;
  friend bool operator==(const XsensOutput&, const XsensOutput&) = default;
};

/// What the odometry uses: counter, time, orientation, acceleration and rate of turn a hundred times a second, 73
/// kbit/s.
[[nodiscard]] std::span<const XsensOutput> default_xsens_outputs() noexcept;

/// A device as it describes itself.
struct XsensDevice {
  std::string product;
  std::uint32_t device_id = 0;
  std::string firmware;
  std::vector<XsensOutput> outputs;

  [[nodiscard]] std::string text() const;  ///< "MTi-630, firmware 1.2.3, sends 1020 1060 2010@100 ..."
};

/// Sets up a device on a serial line and leaves it measuring: it is stopped, asked what it is, told `outputs`, asked
/// what it made of them, and started. A device keeps its set-up without power. The error says which step failed;
/// outputs that the device does not offer, or not that often, are one. Takes a second or two.
[[nodiscard]] Expected<XsensDevice> set_up_xsens(const std::string& path, unsigned baud,
                                                 std::span<const XsensOutput> outputs,
                                                 std::chrono::milliseconds patience = std::chrono::milliseconds(500));

}  // namespace roadvec
