#include "drivers/can/motion_decoder.h"

#include <algorithm>

#include "core/base/angle.h"

namespace roadvec {
namespace {

// Which of the given wheel speeds stands for front left, front right, rear left, rear right.
constexpr std::array<std::array<std::size_t, 4>, 4> kWheelOf = {
    {{0, 0, 0, 0}, {0, 1, 0, 1}, {0, 1, 2, 2}, {0, 1, 2, 3}}};

std::string lower_case(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return text;
}

/// Radians per unit.
Expected<double> steering_unit(const std::string& written, double /*wheel_radius_m*/) {
  const std::string unit = lower_case(written);
  if (unit == "rad") return 1.0;
  // The degree sign in cp1252 and in UTF-8.
  if (unit == "deg" || unit == "degree" || unit == "degrees" || unit == "\xB0" || unit == "\xC2\xB0" ||
      unit == "unit_degreofarc") {  // as Volkswagen spells it
    return rad_from_deg(1.0);
  }
  return fail("its unit '" + written + "' is no angle: set the unit, deg or rad");
}

/// Metres per second per unit.
Expected<double> wheel_speed_unit(const std::string& written, double wheel_radius_m) {
  const std::string unit = lower_case(written);
  if (unit == "km/h" || unit == "kph" || unit == "kmh" || unit == "unit_kilometerperhour") return 1.0 / 3.6;
  if (unit == "m/s" || unit == "mps") return 1.0;
  if (unit == "mph") return 0.44704;
  if (unit == "rad/s" || unit == "rpm") {
    if (!(wheel_radius_m > 0.0))
      return fail("its unit '" + written + "' needs the radius of the wheels: set wheel_radius_m");
    return unit == "rpm" ? wheel_radius_m * kTwoPi / 60.0 : wheel_radius_m;
  }
  return fail("its unit '" + written + "' is no speed: set the unit, one of km/h, kph, m/s, mph, rad/s, rpm");
}

/// A signal that says something of others of `message`; nothing where `name` is empty.
Expected<std::optional<SignalDecoder>> beside(const DbcFile& dbc, const std::string& name, const DbcMessage& message) {
  if (name.empty()) return std::optional<SignalDecoder>{};
  const Expected<DbcSignalRef> found = find_signal(dbc, name);
  if (!found) return fail(found.error().message);
  if (found->message != &message) return fail("signal '" + name + "' is of another message than " + message.name);
  Expected<SignalDecoder> decoder = SignalDecoder::create(*found->message, *found->signal);
  if (!decoder) return fail(decoder.error().message);
  return std::optional<SignalDecoder>{*std::move(decoder)};
}

}  // namespace

Expected<MotionDecoder::Quantity> MotionDecoder::quantity(const DbcFile& dbc, const SignalExpression& expression,
                                                          Units units, double wheel_radius_m) {
  if (expression.sum.empty()) return fail("a wheel speed without a signal");
  if (expression.sum.size() > kMaxTerms)
    return fail("a sum of more than four signals: " + expression.sum.front() + " + ...");
  Quantity result;
  std::optional<DbcSignalRef> first;
  for (const std::string& name : expression.sum) {
    const Expected<DbcSignalRef> found = find_signal(dbc, name);
    if (!found) return fail(found.error().message);
    if (!first) first = *found;
    if (found->message != first->message)
      return fail("signals that are summed must be of one message, '" + name + "' is not");
    if (expression.unit.empty() && found->signal->unit != first->signal->unit) {
      return fail("signals that are summed must have one unit, '" + name + "' has another");
    }
    const Expected<SignalDecoder> decoder = SignalDecoder::create(*found->message, *found->signal);
    if (!decoder) return fail(decoder.error().message);
    result.terms[result.term_count++] = *decoder;
  }
  const Expected<std::optional<SignalDecoder>> sign = beside(dbc, expression.sign, *first->message);
  const Expected<std::optional<SignalDecoder>> valid = beside(dbc, expression.valid, *first->message);
  if (!sign) return fail("sign: " + sign.error().message);
  if (!valid) return fail("valid: " + valid.error().message);
  const Expected<double> si = units(expression.unit.empty() ? first->signal->unit : expression.unit, wheel_radius_m);
  if (!si) return fail("signal '" + expression.sum.front() + "': " + si.error().message);
  result.sign = *sign;
  result.valid = *valid;
  result.valid_raw = expression.valid_raw;
  result.invalid_raw = expression.invalid_raw;
  result.factor = expression.scale * *si;
  result.id = first->message->id;
  return result;
}

Expected<MotionDecoder> MotionDecoder::create(const DbcFile& dbc, const VehicleSignals& signals) {
  MotionDecoder decoder;
  if (signals.steering.sum.empty() && signals.wheel_speeds.empty())
    return fail("neither a steering nor a wheel speed signal is named");
  if (signals.wheel_speeds.size() > 4) return fail("more than four wheel speed signals are named");
  if (!signals.steering.sum.empty()) {
    Expected<Quantity> steering = quantity(dbc, signals.steering, steering_unit, signals.wheel_radius_m);
    if (!steering) return fail(steering.error().message);
    decoder.steering_ = *steering;
    decoder.add_id(steering->id);
  }
  for (const SignalExpression& expression : signals.wheel_speeds) {
    Expected<Quantity> wheel = quantity(dbc, expression, wheel_speed_unit, signals.wheel_radius_m);
    if (!wheel) return fail(wheel.error().message);
    decoder.wheels_.push_back(*wheel);
    decoder.add_id(wheel->id);
  }
  if (const Expected<void> watched = decoder.watch_messages(dbc, signals.messages); !watched) {
    return fail(watched.error().message);
  }
  return decoder;
}

Expected<void> MotionDecoder::watch_messages(const DbcFile& dbc, const std::vector<MessageCheck>& checks) {
  for (const CanId id : ids_) {
    watches_.emplace_back(*std::find_if(dbc.messages.begin(), dbc.messages.end(),
                                        [id](const DbcMessage& message) { return message.id == id; }));
  }
  for (const MessageCheck& check : checks) {
    const auto named = [&check](const DbcMessage& message) { return message.name == check.message; };
    const auto message = std::find_if(dbc.messages.begin(), dbc.messages.end(), named);
    const auto watch = std::find_if(watches_.begin(), watches_.end(), [&](const MessageWatch& w) {
      return message != dbc.messages.end() && w.id() == message->id;
    });
    if (watch == watches_.end()) return fail("message '" + check.message + "' carries none of the signals in use");
    if (Expected<void> added = watch->add(dbc, check); !added) return added;
  }
  return {};
}

void MotionDecoder::add_id(CanId id) {
  if (std::find(ids_.begin(), ids_.end(), id) == ids_.end()) ids_.push_back(id);
}

/// What is to be known of the message before its values are; false: the frame must not be used.
bool MotionDecoder::watch(const CanFrame& frame) noexcept {
  const CanId id{frame.id, frame.extended};
  bool accepted = false;
  for (MessageWatch& watch : watches_) {
    if (watch.id() == id) accepted = watch.accept(frame, counters_.messages);
    if (!watch.falls_silent(frame.time, counters_.messages)) continue;
    for (std::size_t i = 0; i < wheels_.size(); ++i) {
      if (wheels_[i].id == watch.id()) fresh_ &= ~(1u << i);
    }
  }
  return accepted;
}

/// The car says that the quantity may be used, or says nothing about it.
bool MotionDecoder::is_valid(const Quantity& quantity, const CanFrame& frame) noexcept {
  if (!quantity.valid) return true;
  const std::optional<std::uint64_t> told = quantity.valid->raw(frame);
  const bool valid = told && (quantity.valid_raw ? *told == *quantity.valid_raw : *told != 0);
  if (!told && !quantity.valid->fits(frame)) {
    ++counters_.short_frame_count;
  } else if (!valid) {
    ++counters_.not_valid_count;
  }
  return valid;
}

std::optional<double> MotionDecoder::term(const Quantity& quantity, std::size_t i, const CanFrame& frame) noexcept {
  const SignalDecoder& decoder = quantity.terms[i];
  const std::optional<std::uint64_t> raw = decoder.raw(frame);
  const std::optional<double> value = decoder.physical(frame);
  // A frame of another multiplexed group is long enough and not an error.
  if (!raw && !decoder.fits(frame)) ++counters_.short_frame_count;
  if (raw && (!value || raw == quantity.invalid_raw)) {
    ++counters_.invalid_value_count;
    return std::nullopt;
  }
  return value;
}

std::optional<double> MotionDecoder::evaluate(const Quantity& quantity, const CanFrame& frame) noexcept {
  if (!is_valid(quantity, frame)) return std::nullopt;
  double sum = 0.0;
  for (std::size_t i = 0; i < quantity.term_count; ++i) {
    const std::optional<double> value = term(quantity, i, frame);
    if (!value) return std::nullopt;
    sum += *value;
  }
  if (quantity.sign) {
    const std::optional<std::uint64_t> sign = quantity.sign->raw(frame);
    if (!sign) {
      if (!quantity.sign->fits(frame)) ++counters_.short_frame_count;
      return std::nullopt;
    }
    if (*sign != 0) sum = -sum;
  }
  return sum * quantity.factor;
}

std::span<const MotionSample> MotionDecoder::decode(const CanFrame& frame) noexcept {
  std::size_t count = 0;
  if (frame.error || frame.remote || !watch(frame)) return {};
  const CanId id{frame.id, frame.extended};
  if (steering_ && steering_->id == id) {
    if (const std::optional<double> wheel_rad = evaluate(*steering_, frame)) {
      samples_[count++] = {frame.time, SteeringAngle{*wheel_rad}};
      ++counters_.steering_count;
    }
  }
  bool any = false;
  for (std::size_t i = 0; i < wheels_.size(); ++i) {
    if (wheels_[i].id != id) continue;
    const std::optional<double> speed_mps = evaluate(wheels_[i], frame);
    if (!speed_mps) continue;
    speeds_mps_[i] = *speed_mps;
    fresh_ |= 1u << i;
    any = true;
  }
  if (any && fresh_ == (1u << wheels_.size()) - 1) {
    fresh_ = 0;
    const auto& wheel_of = kWheelOf[wheels_.size() - 1];
    samples_[count++] = {frame.time, WheelSpeed{speeds_mps_[wheel_of[0]], speeds_mps_[wheel_of[1]],
                                                speeds_mps_[wheel_of[2]], speeds_mps_[wheel_of[3]]}};
    ++counters_.wheel_speed_count;
  }
  return std::span(samples_).first(count);
}

}  // namespace roadvec
