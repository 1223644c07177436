#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "daemon/server/file_descriptor.h"

namespace roadvec {

/// Ring of the newest encoded frames: one writer (optimiser), any number of readers (server for each of its clients,
/// store), each with a position of its own. 16 MiB last about 6 minutes at ten frames of 4.6 kB a second.
///
/// append() never waits and overwrites the oldest frames; a reader that was too slow is told. Whoever must not lose
/// anything registers as a Reader, and the writer asks has_room() first: live, it may wait a bounded time; with
/// recorded input it waits. Reading copies the frame, word by word as atomics, because the writer may come round
/// meanwhile: what was overwritten is noticed and thrown away. All memory is reserved by the constructor.
class FrameLog {
 public:
  using Position = std::uint64_t;  ///< counts words since the beginning; never comes round
  enum class Outcome { frame, nothing_new, overrun };

  explicit FrameLog(std::size_t capacity_bytes);

  /// Writer. The frame fits into the capacity. Rings every Reader's doorbell.
  void append(std::string_view frame) noexcept;
  /// Writer: appending this many bytes overwrites nothing that a Reader has still to read.
  [[nodiscard]] bool has_room(std::size_t frame_bytes) const noexcept;

  /// Any thread: where the oldest frame begins that is still there, or the next will be.
  [[nodiscard]] Position oldest() const noexcept { return tail_.load(std::memory_order_relaxed); }
  /// Any thread: copies the frame at the position and moves it on. Overrun: moves it to the oldest frame there is.
  Outcome read(Position& position, std::string& frame) const;

  /// A thread that follows the log from the beginning. Made before the writer starts, at most kMostReaders.
  class Reader {
   public:
    explicit Reader(FrameLog& log);
    /// The next frame. Wait on doorbell() when there is nothing new.
    Outcome next(std::string& frame);
    [[nodiscard]] Position position() const { return position_.load(std::memory_order_relaxed); }
    [[nodiscard]] int doorbell() const { return doorbell_.get(); }
    void clear_doorbell() const noexcept;
    void ring() const noexcept;  ///< any thread

   private:
    friend class FrameLog;
    FrameLog& log_;
    std::atomic<Position> position_{0};
    FileDescriptor doorbell_;
  };

 private:
  static constexpr std::size_t kMostReaders = 4;
  std::atomic<std::uint64_t>& word(Position position) const { return words_[position & (word_count_ - 1)]; }

  std::size_t word_count_;  ///< a power of two
  std::unique_ptr<std::atomic<std::uint64_t>[]>
      words_;                                  ///< per frame: its length in bytes, then its bytes in whole words
  alignas(64) std::atomic<Position> head_{0};  ///< end of the newest frame
  alignas(64) std::atomic<Position> tail_{0};  ///< begin of the oldest frame that is whole
  std::array<Reader*, kMostReaders> readers_{};
  std::size_t reader_count_ = 0;
};

}  // namespace roadvec
