#include "tools/recording/pcap_writer.h"

#include <gtest/gtest.h>

#include <vector>

#include "drivers/velodyne/packet.h"
#include "tests/support/temporary_folder.h"

namespace roadvec {
namespace {

/// One's complement sum of 16-bit words: all ones over bytes that carry their own checksum. [RFC 1071]
unsigned folded_sum(const std::string& bytes) {
  unsigned sum = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    const unsigned value = static_cast<std::uint8_t>(bytes[i]);
    sum += i % 2 == 0 ? value << 8 : value;
  }
  while (sum >> 16 != 0) sum = (sum & 0xFFFF) + (sum >> 16);
  return sum;
}

TEST(PcapWriter, frames_carry_correct_lengths_checksums_and_nanoseconds) {
  const TemporaryFolder folder;
  std::vector<std::uint8_t> payload(kPacketBytes);
  for (std::size_t i = 0; i < payload.size(); ++i) payload[i] = static_cast<std::uint8_t>(i * 7);
  PcapWriter writer(*OutputFile::create(folder / "a.pcap"));
  writer.write(payload, {1'767'268'800'123'456'789});
  ASSERT_TRUE(writer.close());
  const std::string file = bytes_of(folder / "a.pcap");
  ASSERT_EQ(file.size(), 24 + 16 + 42 + kPacketBytes);
  EXPECT_EQ(file.substr(0, 4), "\x4D\x3C\xB2\xA1");
  const auto u32 = [&](std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 4; i-- > 0;) value = value << 8 | static_cast<std::uint8_t>(file[at + i]);
    return value;
  };
  EXPECT_EQ(u32(24), 1'767'268'800U);
  EXPECT_EQ(u32(28), 123'456'789U);
  EXPECT_EQ(u32(32), 1248U);
  EXPECT_EQ(folded_sum(file.substr(54, 20)), 0xFFFFU);
  const std::string pseudo = file.substr(66, 8) + std::string("\0\x11", 2) + file.substr(78, 2);
  EXPECT_EQ(folded_sum(pseudo + file.substr(74)), 0xFFFFU);
}

}  // namespace
}  // namespace roadvec
