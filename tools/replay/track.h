#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/error.h"
#include "core/base/time.h"
#include "tools/replay/output.h"

namespace roadvec {

/// One sensor's recording and where it is played to.
class Track {
 public:
  struct Counters {
    std::uint64_t sent_count = 0, sent_bytes = 0;
    std::uint64_t lost_count = 0;     ///< due, but nobody listened or the receiver's buffer was full
    std::uint64_t skipped_count = 0;  ///< in the recording, but nothing that can be sent: damaged lines, other traffic
  };

  explicit Track(std::string name) : name_(std::move(name)) {}
  virtual ~Track() = default;

  /// Opens the recording, or goes back to its beginning.
  [[nodiscard]] virtual Expected<void> rewind() = 0;
  /// Goes to the next item and tells its stamp; nothing at the end of the recording.
  [[nodiscard]] virtual std::optional<SensorTime> next() = 0;
  /// Sends the item that next() went to.
  virtual void send(const SendMoment& moment) = 0;

  /// False: without --can or --imu-pty nobody wants this recording.
  [[nodiscard]] virtual bool has_output() const = 0;
  /// False while a pipe or terminal of this track is not open at its other end.
  [[nodiscard]] virtual bool has_listener() = 0;
  [[nodiscard]] virtual std::string destination() const = 0;

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const Counters& counters() const { return counters_; }
  [[nodiscard]] const std::string& warning() const { return warning_; }  ///< "" or why the recording ended early

 protected:
  void count(SendResult result, std::size_t bytes) {
    if (result == SendResult::lost) {
      ++counters_.lost_count;
    } else {
      ++counters_.sent_count;
      counters_.sent_bytes += bytes;
    }
  }
  void count_skipped() { ++counters_.skipped_count; }
  void warn(std::string text) { warning_ = std::move(text); }

 private:
  std::string name_, warning_;
  Counters counters_;
};

}  // namespace roadvec
