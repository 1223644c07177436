#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "drivers/can/asc_line.h"
#include "drivers/can/can_reader.h"
#include "drivers/recording/recording_file.h"

namespace roadvec {

/// Reads what candump has written to a file, or is writing to a FIFO: the latter is quiet where a file ends, and a line
/// is taken when it is whole. Lines without a time are bad: their frames cannot be put beside other sensors. Also reads
/// Vector's ASC; a file's content says which it is.
class CanLogReader : public CanReader {
 public:
  /// `interface`: take the frames of this one alone; "" takes all. `offset_ns` is added to every time. The error names
  /// what else the file is, or quotes its first line.
  [[nodiscard]] static Expected<std::unique_ptr<CanLogReader>> open(const std::string& path,
                                                                    const std::string& interface = "",
                                                                    std::int64_t offset_ns = 0);

  [[nodiscard]] CanReadResult read(CanFrame& frame, std::chrono::milliseconds timeout) noexcept override;
  [[nodiscard]] std::string_view interface_name(std::uint8_t interface) const noexcept override;
  [[nodiscard]] const CanCounters& counters() const noexcept override { return counters_; }

  [[nodiscard]] std::string_view first_bad_line_reason() const noexcept override { return first_bad_line_reason_; }

 private:
  static constexpr std::size_t kMaxInterfaces = 16;
  static constexpr std::size_t kMaxNameBytes = 32;
  struct Name {
    std::array<char, kMaxNameBytes> text{};
    std::size_t length = 0;
    [[nodiscard]] std::string_view view() const noexcept { return {text.data(), length}; }
  };

  CanLogReader(RecordingFile file, const std::string& interface, std::int64_t offset_ns, bool asc)
      : file_(std::move(file)), wanted_(interface), offset_ns_(offset_ns), is_asc_(asc) {}
  bool next_frame(CanFrame& frame) noexcept;
  bool number_of(std::string_view name, std::uint8_t& number) noexcept;
  void count_bad_line(std::string_view reason) noexcept;

  RecordingFile file_;
  std::string wanted_;
  std::int64_t offset_ns_;
  bool is_asc_;
  AscLines asc_;
  std::array<Name, kMaxInterfaces> names_;
  std::size_t name_count_ = 0;
  CanCounters counters_;
  std::string_view first_bad_line_reason_;
};

}  // namespace roadvec
