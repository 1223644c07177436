#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "core/base/error.h"
#include "drivers/imu/imu_reader.h"
#include "drivers/recording/recording_file.h"

namespace roadvec {

inline constexpr std::size_t kMaxImuLineBytes = 4096;

struct ImuLogLine {
  SensorTime time;
  std::size_t byte_count = 0;
};

/// "(seconds.fraction) hexbytes"; the bytes go to the front of `bytes`. Nothing: the line is not of this form, or holds
/// more than fits. Pure.
[[nodiscard]] std::optional<ImuLogLine> parse_imu_log_line(std::string_view line,
                                                           std::span<std::uint8_t> bytes) noexcept;

/// Reads an imu.log, line by line.
class ImuLogReader : public ImuReader {
 public:
  [[nodiscard]] static Expected<std::unique_ptr<ImuLogReader>> open(const std::string& path);

  [[nodiscard]] ImuReadResult read(ImuBytes& bytes, std::chrono::milliseconds timeout) noexcept override;
  [[nodiscard]] const ImuCounters& counters() const noexcept override { return counters_; }

 private:
  explicit ImuLogReader(RecordingFile file) : file_(std::move(file)) {}

  RecordingFile file_;
  std::array<std::uint8_t, kMaxImuLineBytes> bytes_{};
  ImuCounters counters_;
};

/// Reads a file of a device's bytes as they are, without times.
class ImuRawReader : public ImuReader {
 public:
  [[nodiscard]] static Expected<std::unique_ptr<ImuRawReader>> open(const std::string& path);

  [[nodiscard]] ImuReadResult read(ImuBytes& bytes, std::chrono::milliseconds timeout) noexcept override;
  [[nodiscard]] const ImuCounters& counters() const noexcept override { return counters_; }

 private:
  explicit ImuRawReader(RecordingFile file) : file_(std::move(file)) {}

  RecordingFile file_;
  ImuCounters counters_;
};

/// By the ending of the name: .bin is raw, everything else a log.
[[nodiscard]] Expected<std::unique_ptr<ImuReader>> open_imu_recording(const std::string& path);

}  // namespace roadvec
