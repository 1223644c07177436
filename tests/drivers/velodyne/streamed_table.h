#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace roadvec {

/// The status bytes of a made-up HDL-64E, packet after packet: 4160 of them carry its table once. Laser n of it has
/// elevation -n * 0.25 degrees, rotation (n - 32) * 0.1, far correction 1200 + n mm, near ones 1210 + n and 1220 + n,
/// offsets 200 and 26 mm, focal distance 12 m and slope 1.1, intensity 10 to 250.
class StreamedTable {
 public:
  static constexpr unsigned kPackets = 4160, kBytes = 1820;
  struct Packet {
    std::uint8_t type, value;
  };

  explicit StreamedTable(bool s3, std::uint8_t power_level = 0xA0) : s3_(s3) {
    constexpr std::string_view kMarker = "UNIT#";
    for (std::size_t i = 0; i < kMarker.size(); ++i) bytes[i] = static_cast<std::uint8_t>(kMarker[i]);
    for (unsigned n = 0; n < 64; ++n) {
      const std::size_t at = laser_byte(n);
      bytes[at] = static_cast<std::uint8_t>(n);
      const int k = static_cast<int>(n);
      const std::array fields{-k * 25, (k - 32) * 10, 1200 + k, 1210 + k, 1220 + k, 200, 26, 12'000, 11};
      for (std::size_t f = 0; f < fields.size(); ++f) put(at + 1 + 2 * f, fields[f]);
      bytes[at + 19] = 10;
      bytes[at + 20] = 250;
    }
    bytes[kBytes - 5] = 2;
    bytes[kBytes - 3] = power_level;
    put_trailer();
  }

  [[nodiscard]] static constexpr std::size_t laser_byte(unsigned n) { return 7 + 28UL * n; }
  void put_trailer() { put(kBytes - 2, s3_ ? crc() : static_cast<int>(kBytes)); }

  [[nodiscard]] Packet peek() const {
    constexpr std::string_view kTypes = "HMSDNYGTV1234567";
    const unsigned slot = position_ % 16, cycle = position_ / 16;
    if (slot < 9) return {static_cast<std::uint8_t>(kTypes[slot]), slot == 6 ? std::uint8_t{'P'} : std::uint8_t{7}};
    const bool warns = s3_ && slot == 9 && cycle % 4 == 0 && cycle != 0 && cycle != 256;
    return {static_cast<std::uint8_t>(warns ? 'W' : kTypes[slot]), bytes[cycle * 7 + slot - 9]};
  }
  Packet next() {
    const Packet packet = peek();
    skip(1);
    return packet;
  }
  void skip(unsigned count) { position_ = (position_ + count) % kPackets; }

  std::array<std::uint8_t, kBytes> bytes{};

 private:
  void put(std::size_t at, int value) {
    bytes[at] = static_cast<std::uint8_t>(value & 0xFF);
    bytes[at + 1] = static_cast<std::uint8_t>(value >> 8 & 0xFF);
  }
  /// By long division, bit after bit, as the manual's figure draws it.
  [[nodiscard]] int crc() const {
    unsigned remainder = 0;
    for (unsigned n = 0; n < 64; ++n) {
      for (std::size_t i = 1; i < 21; ++i) {
        for (int bit = 7; bit >= 0; --bit) {
          const unsigned in = bytes[laser_byte(n) + i] >> bit & 1U, out = remainder >> 15 & 1U;
          remainder = (remainder << 1 & 0xFFFF) ^ (in != out ? 0x8005U : 0U);
        }
      }
    }
    return static_cast<int>(remainder);
  }

  bool s3_;
  unsigned position_ = 0;
};

}  // namespace roadvec
