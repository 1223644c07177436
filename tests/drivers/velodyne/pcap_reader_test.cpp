#include "drivers/velodyne/pcap_reader.h"

#include <gmock/gmock.h>

#include "tests/drivers/velodyne/packets.h"
#include "tests/drivers/velodyne/temp_file.h"

namespace roadvec {
namespace {

using testing::HasSubstr;
using Bytes = std::vector<std::uint8_t>;

void put_little(Bytes& bytes, std::uint32_t value, int count = 4) {
  for (int i = 0; i < count; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}
void put_big(Bytes& bytes, std::uint32_t value, int count = 2) {
  for (int i = count - 1; i >= 0; --i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

struct FrameShape {
  int vlan_tags = 0, ip_option_words = 0, port = kDataPort, padding = 0;
  unsigned fragment_word = 0, ether_type = 0x0800, protocol = 17;
  std::uint32_t source = 0xC0A80305;  // 192.168.3.5
};

Bytes ethernet_frame(const Bytes& payload, const FrameShape& shape = {}) {
  Bytes frame(12, 0x11);
  for (int tag = 0; tag < shape.vlan_tags; ++tag) {
    put_big(frame, tag == 0 && shape.vlan_tags > 1 ? 0x88A8 : 0x8100);
    put_big(frame, 42);
  }
  put_big(frame, shape.ether_type);
  const auto udp_bytes = static_cast<std::uint32_t>(8 + payload.size());
  const auto header_words = static_cast<std::uint32_t>(5 + shape.ip_option_words);
  put_big(frame, 0x40 | header_words, 1);
  put_big(frame, 0, 1);
  put_big(frame, header_words * 4 + udp_bytes);
  put_big(frame, 7);
  put_big(frame, shape.fragment_word);
  put_big(frame, 64, 1);
  put_big(frame, shape.protocol, 1);
  put_big(frame, 0);
  put_big(frame, shape.source, 4);
  put_big(frame, 0xFFFFFFFF, 4);
  for (int word = 0; word < shape.ip_option_words; ++word) put_big(frame, 0x01010101, 4);
  put_big(frame, 443);
  put_big(frame, static_cast<std::uint32_t>(shape.port));
  put_big(frame, udp_bytes);
  put_big(frame, 0);
  frame.insert(frame.end(), payload.begin(), payload.end());
  frame.resize(frame.size() + static_cast<std::size_t>(shape.padding), 0xAA);
  return frame;
}

Bytes data_payload(std::uint8_t mark) {
  Bytes payload(kPacketBytes, 0);
  payload[0] = 0xFF;
  payload[1] = 0xEE;
  payload[1203] = mark;
  return payload;
}

/// A capture under construction.
struct Pcap {
  explicit Pcap(std::uint32_t magic = 0xA1B2C3D4, std::uint32_t link = 1) {
    put_little(bytes, magic);
    put_little(bytes, 2, 2);
    put_little(bytes, 4, 2);
    put_little(bytes, 0);
    put_little(bytes, 0);
    put_little(bytes, 65535);
    put_little(bytes, link);
  }
  Pcap& add(const Bytes& frame, std::uint32_t seconds = 100, std::uint32_t fraction = 250) {
    put_little(bytes, seconds);
    put_little(bytes, fraction);
    put_little(bytes, static_cast<std::uint32_t>(frame.size()));
    put_little(bytes, static_cast<std::uint32_t>(frame.size()));
    bytes.insert(bytes.end(), frame.begin(), frame.end());
    return *this;
  }
  Bytes bytes;
};

/// Everything a capture gives.
struct Read {
  explicit Read(const Pcap& pcap, const PcapReaderOptions& options = {}) : file(pcap.bytes) {
    auto opened = PcapReader::open(file.path(), options, counters);
    if (!opened) {
      error = opened.error().message;
      return;
    }
    reader = std::move(*opened);
    std::span<const RawPacket> batch;
    while ((result = reader->read(batch, {})) == ReadResult::packets)
      packets.insert(packets.end(), batch.begin(), batch.end());
    error = reader->error();
  }
  [[nodiscard]] LidarCounts counts() const { return snapshot(counters); }

  TempFile file;
  LidarCounters counters;
  std::unique_ptr<PcapReader> reader;
  std::vector<RawPacket> packets;
  ReadResult result = ReadResult::failed;
  std::string error;
};

TEST(PcapReader, reads_microsecond_and_nanosecond_stamps_and_the_sender) {
  const Read us(Pcap(0xA1B2C3D4).add(ethernet_frame(data_payload(1))));
  ASSERT_EQ(us.packets.size(), 1U) << us.error;
  EXPECT_EQ(us.packets[0].arrived.ns, 100'000'250'000);
  EXPECT_EQ(us.packets[0].source_ipv4, 0xC0A80305U);
  EXPECT_EQ(us.packets[0].bytes[1203], 1);
  EXPECT_EQ(us.result, ReadResult::end);
  const Read ns(Pcap(0xA1B23C4D).add(ethernet_frame(data_payload(1))));
  ASSERT_EQ(ns.packets.size(), 1U);
  EXPECT_EQ(ns.packets[0].arrived.ns, 100'000'000'250);
}

TEST(PcapReader, looks_through_vlan_tags_ip_options_and_padding) {
  for (const FrameShape& shape :
       {FrameShape{.vlan_tags = 1}, FrameShape{.vlan_tags = 2}, FrameShape{.ip_option_words = 3},
        FrameShape{.padding = 9}, FrameShape{.vlan_tags = 1, .ip_option_words = 10, .padding = 2}}) {
    const Read read(Pcap().add(ethernet_frame(data_payload(9), shape)));
    ASSERT_EQ(read.packets.size(), 1U);
    EXPECT_EQ(read.packets[0].bytes[1203], 9);
  }
}

TEST(PcapReader, reads_captures_of_the_any_device) {
  const Bytes ethernet = ethernet_frame(data_payload(3));
  const Bytes ip(ethernet.begin() + 14, ethernet.end());
  Bytes cooked(14, 0), cooked2;
  put_big(cooked, 0x0800);
  put_big(cooked2, 0x0800);
  cooked2.resize(20, 0);
  cooked.insert(cooked.end(), ip.begin(), ip.end());
  cooked2.insert(cooked2.end(), ip.begin(), ip.end());
  EXPECT_EQ(Read(Pcap(0xA1B2C3D4, 113).add(cooked)).packets.size(), 1U);
  EXPECT_EQ(Read(Pcap(0xA1B2C3D4, 276).add(cooked2)).packets.size(), 1U);
  EXPECT_EQ(Read(Pcap(0xA1B2C3D4, 101).add(ip)).packets.size(), 1U);
}

TEST(PcapReader, takes_packets_of_its_port_alone_or_of_any) {
  const Pcap pcap = Pcap()
                        .add(ethernet_frame(data_payload(1), {.port = 2369}))
                        .add(ethernet_frame(Bytes(512, 0), {.port = kPositionPort}))
                        .add(ethernet_frame(data_payload(2)))
                        .add(ethernet_frame(Bytes(100, 0), {.port = 53}));
  const Read read(pcap);
  EXPECT_EQ(read.packets.size(), 1U);
  EXPECT_EQ(read.reader->position_packet_count(), 1U);
  EXPECT_EQ(read.reader->other_frame_count(), 2U);
  EXPECT_EQ(read.counts().wrong_length, 0U);
  EXPECT_EQ(Read(pcap, {.port = 2369}).packets.size(), 1U);
  const Read any(pcap, {.port = 0});
  EXPECT_EQ(any.packets.size(), 2U);
  EXPECT_EQ(any.reader->position_packet_count(), 1U);
}

TEST(PcapReader, counts_wrong_lengths_foreign_senders_and_fragments) {
  Bytes shorter = data_payload(1), longer = data_payload(1);
  shorter.pop_back();
  longer.push_back(0);
  const Read read(
      Pcap()
          .add(ethernet_frame(shorter))
          .add(ethernet_frame(longer))
          .add(ethernet_frame({}))
          .add(ethernet_frame(Bytes(512, 0)))
          .add(ethernet_frame(data_payload(1), {.fragment_word = 0x2000}))
          .add(ethernet_frame(data_payload(1), {.fragment_word = 0x00B9}))
          .add(ethernet_frame(data_payload(1), {.fragment_word = 0x4000}))  // "don't fragment" is no fragment
          .add(ethernet_frame(data_payload(1), {.source = 0x0A000001})),
      {.source_ipv4 = 0xC0A80305});
  EXPECT_EQ(read.packets.size(), 1U);
  EXPECT_EQ(read.counts().received, 1U);
  EXPECT_EQ(read.counts().wrong_length, 4U);
  EXPECT_EQ(read.counts().foreign_source, 1U);
  EXPECT_EQ(read.reader->fragment_count(), 2U);
}

TEST(PcapReader, passes_over_frames_that_are_not_udp_or_cut_short) {
  Pcap pcap;
  pcap.add(ethernet_frame(data_payload(1), {.ether_type = 0x86DD}))
      .add(ethernet_frame(data_payload(1), {.protocol = 6}));
  const Bytes whole = ethernet_frame(data_payload(1), {.vlan_tags = 1});
  for (const std::size_t bytes : {0U, 1U, 13U, 15U, 17U, 37U, 45U})
    pcap.add(Bytes(whole.begin(), whole.begin() + static_cast<long>(bytes)));
  const Read read(pcap);
  EXPECT_TRUE(read.packets.empty());
  EXPECT_EQ(read.reader->other_frame_count(), 9U);
  EXPECT_EQ(read.result, ReadResult::end);
}

TEST(PcapReader, delivers_what_lies_before_a_cut_off_record_and_then_fails) {
  Pcap pcap;
  for (std::uint8_t i = 0; i < 70; ++i) pcap.add(ethernet_frame(data_payload(i)));
  pcap.bytes.resize(pcap.bytes.size() - 500);
  const Read read(pcap);
  EXPECT_EQ(read.packets.size(), 69U);
  EXPECT_EQ(read.packets.back().bytes[1203], 68);
  EXPECT_EQ(read.result, ReadResult::failed);
  EXPECT_THAT(read.error, testing::AllOf(HasSubstr(read.file.path().string()), HasSubstr("cut off")));
}

TEST(PcapReader, says_what_is_wrong_with_a_file_it_cannot_open) {
  LidarCounters counters;
  EXPECT_THAT(PcapReader::open("/nowhere/lidar.pcap", {}, counters).error().message,
              HasSubstr("/nowhere/lidar.pcap: no such file"));
  const TempFile text(std::string("this is not a capture at all, only text"));
  EXPECT_THAT(PcapReader::open(text.path(), {}, counters).error().message, HasSubstr("not a pcap"));
  const TempFile empty(std::string{});
  EXPECT_THAT(PcapReader::open(empty.path(), {}, counters).error().message, HasSubstr("not a pcap"));
  EXPECT_THAT(Read(Pcap(0xA1B2C3D4, 127)).error, HasSubstr("link layer IEEE802_11_RADIO is not supported"));
}

TEST(PcapReader, gives_the_end_again_when_asked_again) {
  Read read(Pcap().add(ethernet_frame(data_payload(1))));
  std::span<const RawPacket> batch;
  EXPECT_EQ(read.reader->read(batch, {}), ReadResult::end);
  EXPECT_TRUE(batch.empty());
}

}  // namespace
}  // namespace roadvec
