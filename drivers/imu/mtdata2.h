#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace roadvec {

/// What the axes of an orientation's reference frame point to, as the device's output format says.
enum class XsensFrame : std::uint8_t { east_north_up = 0, north_east_down = 4, north_west_up = 8 };

/// Date and time of day.
struct XsensUtc {
  std::uint32_t nanosecond = 0;
  std::uint16_t year = 0;
  std::uint8_t month = 0, day = 0, hour = 0, minute = 0, second = 0;
  std::uint8_t flags = 0;  ///< bits 0, 1, 2: date, time of day, leap seconds are valid
};

/// What one MTData2 message says, in the axes of the sensor and in its own units. [XsensMT0605P, MTData2]
struct XsensSample {
  std::uint16_t packet_counter = 0;
  std::uint32_t time_fine = 0;      ///< ticks of 100 us; wraps after 119 hours
  std::uint32_t time_coarse_s = 0;  ///< whole seconds
  std::uint32_t status = 0;         ///< status byte, or the word that begins with it
  std::array<double, 3> acceleration_mps2{};
  std::array<double, 3> rate_radps{};
  std::array<double, 4> quaternion{};  ///< real part first; turns sensor axes into those of `frame`
  std::array<double, 9> matrix{};      ///< sensor to `frame`, column by column
  std::array<double, 3> euler_deg{};   ///< roll, pitch, yaw: R = Rz Ry Rx, sensor to `frame`
  XsensFrame frame = XsensFrame::east_north_up;
  // What only some devices send, or only when asked.
  std::optional<std::array<double, 3>> acceleration_hr_mps2, rate_hr_radps;  ///< as it is measured, at up to 2 kHz
  std::optional<std::array<double, 3>> delta_v_mps, free_acceleration_mps2, magnetic_field, velocity_mps, ecef_m;
  std::optional<std::array<double, 4>> delta_q;  ///< turn since the message before, real part first
  std::optional<std::array<double, 2>> latitude_longitude_deg;
  std::optional<std::array<double, 1>> temperature_c, altitude_m;
  std::optional<std::uint32_t> pressure_pa;
  std::optional<XsensUtc> utc;
  bool has_packet_counter = false, has_time_fine = false, has_time_coarse = false, has_status = false;
  bool has_acceleration = false, has_rate = false, has_quaternion = false, has_matrix = false, has_euler = false;
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

/// What a stream of Xbus messages, which MTData2 is one of, begins with.
enum class XbusFront : std::uint8_t { incomplete, noise, bad_checksum, message };
struct XbusMessage {
  std::uint8_t kind = 0;
  std::span<const std::uint8_t> content;
  std::size_t byte_count = 0;  ///< of the whole message
};
[[nodiscard]] XbusFront read_xbus(std::span<const std::uint8_t> bytes, XbusMessage& message) noexcept;

inline constexpr std::uint8_t kXsensDeviceError = 0x42;  ///< message id [XsensMT0605P]
inline constexpr std::size_t kMaxXbusBytes = 7 + 2048;   ///< [XsensMT0605P]: no message is longer

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
  void count_lost(const XsensSample& sample) noexcept;

  std::array<std::uint8_t, 2 * kMaxXbusBytes> buffer_{};
  std::size_t begin_ = 0;  ///< what is not read yet is [begin_, end_)
  std::size_t end_ = 0;
  std::uint16_t last_packet_ = 0;
  bool has_last_packet_ = false;
  XsensCounters counters_;
};

}  // namespace roadvec
