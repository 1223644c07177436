#include "daemon/server/frame_log.h"

#include <sys/eventfd.h>

#include <bit>
#include <cerrno>
#include <cstring>
#include <system_error>

#include "core/base/ensure.h"

namespace roadvec {
namespace {

constexpr std::size_t kWordBytes = sizeof(std::uint64_t);

std::uint64_t words_for(std::size_t frame_bytes) { return 1 + (frame_bytes + kWordBytes - 1) / kWordBytes; }

}  // namespace

FrameLog::FrameLog(std::size_t capacity_bytes)
    : word_count_(std::bit_ceil(capacity_bytes / kWordBytes + 2)),
      words_(new std::atomic<std::uint64_t>[word_count_]()) {}

void FrameLog::append(std::string_view frame) noexcept {
  const Position begin = head_.load(std::memory_order_relaxed), end = begin + words_for(frame.size());
  ENSURE(end - begin <= word_count_);
  Position tail = tail_.load(std::memory_order_relaxed);
  while (end - tail > word_count_) tail += words_for(word(tail).load(std::memory_order_relaxed));
  // (A) The tail moves before the words it gives up are overwritten. Every word is then stored with release: a reader
  // that sees one of the new words (acquire) sees the new tail too, and throws away what it has copied. Fences would
  // do, but TSan does not see them.
  tail_.store(tail, std::memory_order_relaxed);
  word(begin).store(frame.size(), std::memory_order_release);
  for (Position at = begin + 1; at < end; ++at) {
    std::uint64_t value = 0;
    const std::size_t offset = (at - begin - 1) * kWordBytes;
    std::memcpy(&value, frame.data() + offset, std::min(kWordBytes, frame.size() - offset));
    word(at).store(value, std::memory_order_release);
  }
  head_.store(end,
              std::memory_order_release);  // (B) release: pairs with the acquire in read(); the frame before its end
  for (std::size_t i = 0; i < reader_count_; ++i) readers_[i]->ring();
}

bool FrameLog::has_room(std::size_t frame_bytes) const noexcept {
  const Position end = head_.load(std::memory_order_relaxed) + words_for(frame_bytes);
  for (std::size_t i = 0; i < reader_count_; ++i) {
    if (end - readers_[i]->position_.load(std::memory_order_acquire) > word_count_) return false;
  }
  return true;
}

FrameLog::Outcome FrameLog::read(Position& position, std::string& frame) const {
  const auto overrun = [&] {
    const Position tail = tail_.load(std::memory_order_relaxed);
    if (tail <= position) return false;
    position = tail;
    return true;
  };
  if (position == head_.load(std::memory_order_acquire)) return Outcome::nothing_new;  // (B)
  const std::uint64_t bytes = word(position).load(std::memory_order_acquire);          // (A)
  if (overrun()) return Outcome::overrun;
  const Position end = position + words_for(bytes);
  frame.resize((end - position - 1) * kWordBytes);
  for (Position at = position + 1; at < end; ++at) {
    const std::uint64_t value = word(at).load(std::memory_order_acquire);  // (A)
    std::memcpy(frame.data() + (at - position - 1) * kWordBytes, &value, kWordBytes);
  }
  if (overrun()) return Outcome::overrun;
  frame.resize(bytes);
  position = end;
  return Outcome::frame;
}

FrameLog::Reader::Reader(FrameLog& log) : log_(log), doorbell_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (doorbell_.get() < 0) throw std::system_error(errno, std::generic_category(), "frame log: eventfd");
  ENSURE(log_.reader_count_ < kMostReaders);
  log_.readers_[log_.reader_count_++] = this;
}

FrameLog::Outcome FrameLog::Reader::next(std::string& frame) {
  Position position = position_.load(std::memory_order_relaxed);
  const Outcome outcome = log_.read(position, frame);
  position_.store(position,
                  std::memory_order_release);  // pairs with has_room(): the copy ends before the writer may come round
  return outcome;
}

void FrameLog::Reader::ring() const noexcept {
  const std::uint64_t one = 1;
  // Full means that it rings already.
  [[maybe_unused]] const ssize_t written = ::write(doorbell_.get(), &one, sizeof one);
}

void FrameLog::Reader::clear_doorbell() const noexcept {
  std::uint64_t count = 0;
  [[maybe_unused]] const ssize_t read = ::read(doorbell_.get(), &count, sizeof count);
}

}  // namespace roadvec
