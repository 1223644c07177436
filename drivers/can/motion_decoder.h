#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/sensor/motion.h"
#include "drivers/can/dbc.h"
#include "drivers/can/frame.h"
#include "drivers/can/message_watch.h"
#include "drivers/can/signals.h"

namespace roadvec {

/// A quantity on the bus: the sum of signals of one message, negative while the sign signal is not zero, times scale.
struct SignalExpression {
  std::vector<std::string> sum;  ///< "Message.Signal"; one or more, all of one message and unit
  std::string sign;              ///< "" or "Message.Signal" of the same message
  double scale = 1.0;            ///< -1 turns the direction round
  std::string unit;              ///< "" takes the unit from the DBC file
  std::string valid;             ///< "" or "Message.Signal" of the same message: used only while this is valid
  std::optional<std::uint64_t> valid_raw;    ///< its raw value that says so; nothing: all but 0
  std::optional<std::uint64_t> invalid_raw;  ///< raw value of a signal of the sum that stands for no value
};

/// What the car's bus calls its steering wheel and its wheels. Units: deg, rad for the steering wheel; km/h, kph, m/s,
/// mph, rad/s, rpm for the wheels.
struct VehicleSignals {
  SignalExpression steering;                   ///< left positive; no names: the car does not tell
  std::vector<SignalExpression> wheel_speeds;  ///< front left, front right, rear left, rear right; two are an axle, one
                                               ///< is the car; three repeat the last; none: the car does not tell
  double wheel_radius_m = 0.0;                 ///< needed for rad/s and rpm
  std::vector<MessageCheck> messages;          ///< counters, checksums and time-outs
};

struct MotionCounters {
  std::uint64_t steering_count = 0;
  std::uint64_t wheel_speed_count = 0;
  std::uint64_t short_frame_count = 0;    ///< signals that lie beyond the end of their frame
  std::uint64_t invalid_value_count = 0;  ///< floats that are no number, values that stand for none
  std::uint64_t not_valid_count = 0;      ///< values that the car itself said not to use
  MessageCounters messages;
};

/// Turns frames into motion. Wheel speeds that come in several messages become one sample as soon as each has come
/// anew, stamped with the last of them; of a message that has fallen silent, what came before is forgotten. No
/// allocation, no exceptions once made.
class MotionDecoder {
 public:
  /// The error names the signal, what is wrong with it, and near names where it is not in the file.
  [[nodiscard]] static Expected<MotionDecoder> create(const DbcFile& dbc, const VehicleSignals& signals);

  /// Error and remote frames and other messages give nothing. Valid until the next call.
  [[nodiscard]] std::span<const MotionSample> decode(const CanFrame& frame) noexcept;

  [[nodiscard]] std::span<const CanId> ids() const noexcept { return ids_; }  ///< for the reader's filter
  [[nodiscard]] const MotionCounters& counters() const noexcept { return counters_; }

 private:
  static constexpr std::size_t kMaxTerms = 4;
  struct Quantity {
    CanId id;
    std::array<SignalDecoder, kMaxTerms> terms;
    std::size_t term_count = 0;
    std::optional<SignalDecoder> sign, valid;
    std::optional<std::uint64_t> valid_raw, invalid_raw;
    double factor = 1.0;  ///< to SI, and the configured scale
  };
  using Units = Expected<double> (*)(const std::string& unit, double wheel_radius_m);
  [[nodiscard]] static Expected<Quantity> quantity(const DbcFile& dbc, const SignalExpression& expression, Units units,
                                                   double wheel_radius_m);
  [[nodiscard]] Expected<void> watch_messages(const DbcFile& dbc, const std::vector<MessageCheck>& checks);
  [[nodiscard]] bool watch(const CanFrame& frame) noexcept;
  [[nodiscard]] bool is_valid(const Quantity& quantity, const CanFrame& frame) noexcept;
  [[nodiscard]] std::optional<double> term(const Quantity& quantity, std::size_t i, const CanFrame& frame) noexcept;
  [[nodiscard]] std::optional<double> evaluate(const Quantity& quantity, const CanFrame& frame) noexcept;
  void add_id(CanId id);

  std::optional<Quantity> steering_;
  std::vector<Quantity> wheels_;
  std::vector<CanId> ids_;
  std::vector<MessageWatch> watches_;  ///< one per id
  std::array<double, 4> speeds_mps_{};
  unsigned fresh_ = 0;  ///< bit i: wheels_[i] has come since the last sample
  std::array<MotionSample, 2> samples_;
  MotionCounters counters_;
};

}  // namespace roadvec
