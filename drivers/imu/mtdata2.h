#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace roadvec {

/// What the axes of an orientation's reference frame point to, as the device's output format says.
enum class XsensFrame : std::uint8_t { east_north_up = 0, north_east_down = 4, north_west_up = 8 };

/// What one MTData2 message says, in the axes of the sensor and in its own units. [XsensMT0605P, MTData2]
struct XsensSample {
  std::uint16_t packet_counter = 0;
  std::uint32_t time_fine = 0;      ///< ticks of 100 us; wraps after 119 hours
  std::uint32_t time_coarse_s = 0;  ///< whole seconds
  std::uint32_t status = 0;         ///< status byte, or the word that begins with it
  std::array<double, 3> acceleration_mps2{};
  std::array<double, 3> rate_radps{};
  std::array<double, 4> quaternion{};  ///< real part first; turns sensor axes into those of `frame`
  std::array<double, 3> euler_deg{};   ///< roll, pitch, yaw: R = Rz Ry Rx, sensor to `frame`
  XsensFrame frame = XsensFrame::east_north_up;
  bool has_packet_counter = false, has_time_fine = false, has_time_coarse = false, has_status = false;
  bool has_acceleration = false, has_rate = false, has_quaternion = false, has_euler = false;
};

/// What the bytes of a device amounted to.
struct XsensCounters {
  std::uint64_t message_count = 0;        ///< MTData2 messages
  std::uint64_t other_message_count = 0;  ///< messages of another kind, with a correct checksum
  std::uint64_t device_error_count = 0;   ///< of these: the device reports an error
  std::uint64_t lost_message_count = 0;   ///< missing in the device's packet counter
  std::uint64_t bad_checksum_count = 0;
  std::uint64_t skipped_byte_count = 0;    ///< bytes outside messages: noise, or what a bad message was made of
  std::uint64_t malformed_item_count = 0;  ///< items of the wrong size, or beyond the end of their message
};

/// Reads the items of an MTData2 message's content into `sample`; unknown ones are passed over by their size.
/// Returns how many were malformed. Pure.
std::size_t parse_mtdata2(std::span<const std::uint8_t> content, XsensSample& sample) noexcept;

/// Finds the messages in a stream of bytes that may begin, break and continue anywhere: after a bad checksum it looks
/// for the next preamble one byte further on, so a damaged length costs no good message behind it. No allocation.
class Mtdata2Parser {
 public:
  /// Takes bytes off the front of `bytes` up to the end of the next MTData2 message and reads it; false when the bytes
  /// are used up. Call until then.
  [[nodiscard]] bool next(std::span<const std::uint8_t>& bytes, XsensSample& sample) noexcept;

  [[nodiscard]] const XsensCounters& counters() const noexcept { return counters_; }

 private:
  static constexpr std::size_t kMaxContentBytes = 2048;  ///< [XsensMT0605P]: no message is longer
  static constexpr std::size_t kMaxMessageBytes = 7 + kMaxContentBytes;

  enum class Front { incomplete, noise, bad_checksum, message };
  [[nodiscard]] Front front(std::span<const std::uint8_t>& content) const noexcept;
  void count_lost(const XsensSample& sample) noexcept;

  std::array<std::uint8_t, 2 * kMaxMessageBytes> buffer_{};
  std::size_t begin_ = 0;  ///< what is not read yet is [begin_, end_)
  std::size_t end_ = 0;
  std::uint16_t last_packet_ = 0;
  bool has_last_packet_ = false;
  XsensCounters counters_;
};

}  // namespace roadvec
