#include "tools/recording/pcap_writer.h"

#include <vector>

#include "drivers/velodyne/packet.h"

namespace roadvec {
namespace {

constexpr std::uint32_t kNanosecondMagic = 0xA1B23C4D;
constexpr std::uint32_t kSnapLength = 65535, kEthernet = 1;
constexpr std::uint32_t kSource = 0xC0A8032B;       // 192.168.3.43
constexpr std::uint32_t kDestination = 0xFFFFFFFF;  // broadcast
constexpr unsigned kSourcePort = 443;
constexpr unsigned kUdp = 17;

/// Bytes in the order each field needs: the file's are little endian, the network's big endian.
class Bytes {
 public:
  explicit Bytes(std::size_t expected) { bytes_.reserve(expected); }
  void little(std::uint64_t value, int count) {
    for (int i = 0; i < count; ++i) bytes_.push_back(static_cast<std::uint8_t>(value >> 8 * i & 0xFF));
  }
  void big(std::uint64_t value, int count) {
    for (int i = count; i-- > 0;) bytes_.push_back(static_cast<std::uint8_t>(value >> 8 * i & 0xFF));
  }
  void append(std::span<const std::uint8_t> more) { bytes_.insert(bytes_.end(), more.begin(), more.end()); }
  void put_big16(std::size_t at, unsigned value) {
    bytes_[at] = static_cast<std::uint8_t>(value >> 8);
    bytes_[at + 1] = static_cast<std::uint8_t>(value & 0xFF);
  }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }
  [[nodiscard]] std::span<const std::uint8_t> from(std::size_t at) const { return std::span(bytes_).subspan(at); }

 private:
  std::vector<std::uint8_t> bytes_;
};

/// The Internet checksum [RFC 1071] of bytes that follow a sum already begun.
unsigned checksum(std::span<const std::uint8_t> bytes, std::uint32_t sum) {
  for (std::size_t i = 0; i < bytes.size(); ++i) sum += i % 2 == 0 ? static_cast<unsigned>(bytes[i]) << 8 : bytes[i];
  while (sum >> 16 != 0) sum = (sum & 0xFFFF) + (sum >> 16);
  return ~sum & 0xFFFF;
}

std::uint32_t words(std::uint32_t address) { return (address >> 16) + (address & 0xFFFF); }

}  // namespace

PcapWriter::PcapWriter(OutputFile file) : file_(std::move(file)) {
  Bytes header(24);
  header.little(kNanosecondMagic, 4);
  header.little(2, 2);
  header.little(4, 2);
  header.little(0, 8);
  header.little(kSnapLength, 4);
  header.little(kEthernet, 4);
  file_.write(header.from(0));
}

void PcapWriter::write(std::span<const std::uint8_t> payload, SensorTime arrived) {
  constexpr std::size_t kRecord = 16, kLink = 14, kIp = 20, kUdpHeader = 8;
  const std::size_t udp_bytes = kUdpHeader + payload.size(), frame_bytes = kLink + kIp + udp_bytes;
  Bytes record(kRecord + frame_bytes);
  record.little(static_cast<std::uint64_t>(arrived.ns / 1'000'000'000), 4);
  record.little(static_cast<std::uint64_t>(arrived.ns % 1'000'000'000), 4);
  record.little(frame_bytes, 4);
  record.little(frame_bytes, 4);
  record.big(0xFFFFFFFFFFFF, 6);
  record.big(0x6076880020A1, 6);
  record.big(0x0800, 2);
  const std::size_t ip = record.size();
  record.big(0x4500, 2);
  record.big(kIp + udp_bytes, 2);
  record.big(0, 2);
  record.big(0x4000, 2);  // not to be fragmented
  record.big(64, 1);
  record.big(kUdp, 1);
  record.big(0, 2);
  record.big(kSource, 4);
  record.big(kDestination, 4);
  record.put_big16(ip + 10, checksum(record.from(ip), 0));
  const std::size_t udp = record.size();
  record.big(kSourcePort, 2);
  record.big(kDataPort, 2);
  record.big(udp_bytes, 2);
  record.big(0, 2);
  record.append(payload);
  const auto pseudo = static_cast<std::uint32_t>(words(kSource) + words(kDestination) + kUdp + udp_bytes);
  const unsigned sum = checksum(record.from(udp), pseudo);
  record.put_big16(udp + 6, sum == 0 ? 0xFFFF : sum);  // 0 would mean: not computed
  file_.write(record.from(0));
}

}  // namespace roadvec
