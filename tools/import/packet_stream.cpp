#include "tools/import/packet_stream.h"

#include <ctime>

namespace roadvec {
namespace {

constexpr std::size_t kBankLasers = kHeadLasers / 2;
/// No longer than this between two firings of a head that goes on turning.
constexpr std::int64_t kLongestStep_ns = 4 * kFiringPeriod_ns;
constexpr int kUsualStep_cells = 2;

void put_u16(PacketBytes& bytes, std::size_t at, unsigned value) {
  bytes[at] = static_cast<std::uint8_t>(value & 0xFF);
  bytes[at + 1] = static_cast<std::uint8_t>(value >> 8 & 0xFF);
}

/// Bytes 1204 and 1205: of the cycle that a head tells its state in, what a recording still knows: the time.
/// [VelodyneHDL64ES3, app. E]
void put_status(PacketBytes& bytes, SensorTime time, std::uint64_t packet_number) {
  const std::time_t now = time.ns / 1'000'000'000;
  std::tm utc{};
  gmtime_r(&now, &utc);
  const std::array<int, 6> values{utc.tm_hour, utc.tm_min, utc.tm_sec, utc.tm_mday, utc.tm_mon + 1, utc.tm_year - 100};
  const auto slot = static_cast<std::size_t>(packet_number % 16);
  bytes[kReturnModeOffset] = static_cast<std::uint8_t>("HMSDNYGTV1234567"[slot]);
  bytes[kProductIdOffset] = static_cast<std::uint8_t>(slot < values.size() ? values[slot] : 0);
}

}  // namespace

void PacketStream::add(const Firing& firing) {
  if (firing_count_ > 0 && firing.time - last_time_ > kLongestStep_ns) finish();
  const std::size_t first_block = 2 * firing_count_ * kBlockBytes;
  put(firing.time, firing.cell);
  for (std::size_t laser = 0; laser < kHeadLasers; ++laser) {
    const std::size_t at =
        first_block + laser / kBankLasers * kBlockBytes + kBlockEchoesOffset + laser % kBankLasers * kEchoBytes;
    put_u16(packet_.bytes, at, firing.raw[laser]);
    packet_.bytes[at + 2] = firing.intensity[laser];
  }
  if (firing_count_ == kFiringsPerPacket) send();
}

void PacketStream::finish() {
  if (firing_count_ == 0) return;
  while (firing_count_ < kFiringsPerPacket) {
    put(last_time_ + kFiringPeriod_ns, (last_cell_ + kUsualStep_cells) % kEncoderCells);
  }
  send();
}

/// The two blocks of a firing, without echoes.
void PacketStream::put(SensorTime time, int cell) {
  if (firing_count_ == 0) {
    packet_.bytes.fill(0);
    packet_.arrived = time + static_cast<std::int64_t>(kFiringsPerPacket) * kFiringPeriod_ns;
    const auto device_us = static_cast<std::uint32_t>(time.ns % kHour_ns / 1000);
    put_u16(packet_.bytes, kDeviceTimeOffset, device_us & 0xFFFF);
    put_u16(packet_.bytes, kDeviceTimeOffset + 2, device_us >> 16);
    put_status(packet_.bytes, time, packet_count_);
  }
  for (std::size_t bank = 0; bank < 2; ++bank) {
    const std::size_t block = (2 * firing_count_ + bank) * kBlockBytes;
    put_u16(packet_.bytes, block + kBlockFlagOffset, kBankFlags[bank]);
    put_u16(packet_.bytes, block + kBlockAzimuthOffset, static_cast<unsigned>(cell * kCell_cdeg));
  }
  ++firing_count_;
  last_time_ = time;
  last_cell_ = cell;
}

void PacketStream::send() {
  pcap_.write(packet_.bytes, packet_.arrived);
  ++packet_count_;
  firing_count_ = 0;
}

}  // namespace roadvec
