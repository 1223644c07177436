#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"

namespace roadvec {

/// A recording read line by line, or a binary one piece by piece, through one buffer that is reserved when it is
/// opened: reading does not allocate. A line longer than the buffer comes in parts.
class RecordingFile {
 public:
  [[nodiscard]] static Expected<RecordingFile> open(const std::string& path);
  /// A FIFO that is being written to: neither opening nor reading waits for a writer, and it has no end. Writers may
  /// come and go.
  [[nodiscard]] static Expected<RecordingFile> open_fifo(const std::string& path);

  RecordingFile(RecordingFile&& other) noexcept;
  RecordingFile(const RecordingFile&) = delete;
  RecordingFile& operator=(RecordingFile&&) = delete;
  RecordingFile& operator=(const RecordingFile&) = delete;
  ~RecordingFile();

  /// The next line without its end; nothing at the end of the file, or while a FIFO has no whole line: what there is
  /// of it is kept. Valid until the next call.
  [[nodiscard]] std::optional<std::string_view> next_line() noexcept;
  /// The next bytes, whatever they are; empty at the end of the file. Valid until the next call.
  [[nodiscard]] std::span<const std::uint8_t> next_bytes() noexcept;

  /// Waits until a FIFO has bytes to read; false: none came within `timeout`.
  [[nodiscard]] bool wait(std::chrono::milliseconds timeout) const noexcept;

  [[nodiscard]] bool endless() const noexcept { return endless_; }                   ///< it is a FIFO
  [[nodiscard]] std::uint64_t line_number() const noexcept { return line_number_; }  ///< of the last line, from 1
  [[nodiscard]] bool failed() const noexcept { return failed_; }  ///< it ended because the file could not be read

 private:
  static constexpr std::size_t kBufferBytes = 65536;

  RecordingFile(int fd, bool endless) : fd_(fd), endless_(endless), buffer_(kBufferBytes) {}
  bool fill() noexcept;

  int fd_;
  bool endless_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0;  ///< what is read and not handed out is [begin_, end_)
  std::size_t end_ = 0;
  std::uint64_t line_number_ = 0;
  bool failed_ = false;
};

}  // namespace roadvec
