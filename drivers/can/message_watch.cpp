#include "drivers/can/message_watch.h"

#include <cmath>

namespace roadvec {
namespace {

// A message may miss a few turns on a busy bus; five in a row are a sender that is gone.
constexpr std::int64_t kCyclesToSilence = 5;

Expected<SignalDecoder> decoder_of(const DbcFile& dbc, const std::string& name) {
  const Expected<DbcSignalRef> found = find_signal(dbc, name);
  if (!found) return fail(found.error().message);
  return SignalDecoder::create(*found->message, *found->signal);
}

}  // namespace

MessageWatch::MessageWatch(const DbcMessage& message)
    : id_(message.id), timeout_ns_(kCyclesToSilence * 1'000'000 * message.cycle_time_ms) {}

Expected<void> MessageWatch::add(const DbcFile& dbc, const MessageCheck& check) {
  if (check.timeout_s > 0) timeout_ns_ = std::llround(check.timeout_s * 1e9);
  if (!check.counter.empty()) {
    Expected<SignalDecoder> counter = decoder_of(dbc, check.message + "." + check.counter);
    if (!counter) return fail(counter.error().message);
    counter_ = *std::move(counter);
  }
  if (check.checksum.empty() != (check.kind == ChecksumKind::none)) {
    return fail("message '" + check.message + "': name both the checksum's signal and its kind, or neither");
  }
  if (!check.checksum.empty()) {
    Expected<SignalDecoder> checksum = decoder_of(dbc, check.message + "." + check.checksum);
    if (!checksum) return fail(checksum.error().message);
    checksum_ = *std::move(checksum);
    kind_ = check.kind;
    if (kind_ == ChecksumKind::vw_mqb && id_ != CanId{0x86, false}) {
      return fail("message '" + check.message + "': the checksum vw_mqb is known for LWI_01 (0x86) alone");
    }
  }
  return {};
}

bool MessageWatch::accept(const CanFrame& frame, MessageCounters& counters) noexcept {
  if (checksum_) {
    const std::optional<std::uint64_t> told = checksum_->raw(frame);
    CanFrame bare = frame;
    if (told) checksum_->bits().clear(bare);
    if (!told || told != checksum_of(kind_, bare)) {
      ++counters.bad_checksum_count;
      return false;
    }
  }
  last_ = frame.time;
  const std::optional<std::uint64_t> count = counter_ ? counter_->raw(frame) : std::nullopt;
  if (count) {
    if (last_count_ && *count != ((*last_count_ + 1) & counter_->bits().mask)) ++counters.counter_gap_count;
    last_count_ = count;
  }
  return true;
}

bool MessageWatch::falls_silent(SensorTime now, MessageCounters& counters) noexcept {
  if (timeout_ns_ == 0 || !last_ || now.ns - last_->ns <= timeout_ns_) return false;
  last_.reset();
  ++counters.timeout_count;
  return true;
}

}  // namespace roadvec
