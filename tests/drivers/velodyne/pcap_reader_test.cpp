#include "drivers/velodyne/pcap_reader.h"

#include <gmock/gmock.h>
#include <zlib.h>
#include <zstd.h>

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
  explicit Read(const Bytes& bytes, const PcapReaderOptions& options = {}) : file(bytes) {
    auto opened = PcapReader::open(file.path(), options, counters);
    if (!opened) {
      error = opened.error().message;
      return;
    }
    reader = std::move(*opened);
    std::span<const RawPacket> batch;
    while ((result = reader->read(batch, {})) == ReadResult::packets) {
      packets.insert(packets.end(), batch.begin(), batch.end());
      positions.insert(positions.end(), reader->positions().begin(), reader->positions().end());
    }
    error = reader->error();
  }
  [[nodiscard]] LidarCounts counts() const { return snapshot(counters); }

  TempFile file;
  LidarCounters counters;
  std::unique_ptr<PcapReader> reader;
  std::vector<RawPacket> packets;
  std::vector<RawPositionPacket> positions;
  ReadResult result = ReadResult::failed;
  std::string error;
};

TEST(PcapReader, reads_microsecond_and_nanosecond_stamps_and_the_sender) {
  const Read us(Pcap(0xA1B2C3D4).add(ethernet_frame(data_payload(1))).bytes);
  ASSERT_EQ(us.packets.size(), 1U) << us.error;
  EXPECT_EQ(us.packets[0].arrived.ns, 100'000'250'000);
  EXPECT_EQ(us.packets[0].source_ipv4, 0xC0A80305U);
  EXPECT_EQ(us.packets[0].bytes[1203], 1);
  EXPECT_EQ(us.result, ReadResult::end);
  const Read ns(Pcap(0xA1B23C4D).add(ethernet_frame(data_payload(1))).bytes);
  ASSERT_EQ(ns.packets.size(), 1U);
  EXPECT_EQ(ns.packets[0].arrived.ns, 100'000'000'250);
}

TEST(PcapReader, looks_through_vlan_tags_ip_options_and_padding) {
  for (const FrameShape& shape :
       {FrameShape{.vlan_tags = 1}, FrameShape{.vlan_tags = 2}, FrameShape{.ip_option_words = 3},
        FrameShape{.padding = 9}, FrameShape{.vlan_tags = 1, .ip_option_words = 10, .padding = 2}}) {
    const Read read(Pcap().add(ethernet_frame(data_payload(9), shape)).bytes);
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
  EXPECT_EQ(Read(Pcap(0xA1B2C3D4, 113).add(cooked).bytes).packets.size(), 1U);
  EXPECT_EQ(Read(Pcap(0xA1B2C3D4, 276).add(cooked2).bytes).packets.size(), 1U);
  EXPECT_EQ(Read(Pcap(0xA1B2C3D4, 101).add(ip).bytes).packets.size(), 1U);
}

TEST(PcapReader, takes_packets_of_its_port_alone_or_of_any) {
  const Pcap pcap = Pcap()
                        .add(ethernet_frame(data_payload(1), {.port = 2369}))
                        .add(ethernet_frame(Bytes(512, 0), {.port = kPositionPort}))
                        .add(ethernet_frame(data_payload(2)))
                        .add(ethernet_frame(Bytes(100, 0), {.port = 53}));
  const Read read(pcap.bytes);
  EXPECT_EQ(read.packets.size(), 1U);
  EXPECT_EQ(read.counts().position_packets, 1U);
  EXPECT_EQ(read.reader->other_frame_count(), 2U);
  EXPECT_EQ(read.counts().wrong_length, 0U);
  EXPECT_EQ(Read(pcap.bytes, {.port = 2369}).packets.size(), 1U);
  const Read any(pcap.bytes, {.port = 0});
  EXPECT_EQ(any.packets.size(), 2U);
  EXPECT_EQ(any.counts().position_packets, 1U);
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
          .add(ethernet_frame(data_payload(1), {.source = 0x0A000001}))
          .bytes,
      {.source_ipv4 = 0xC0A80305});
  EXPECT_EQ(read.packets.size(), 1U);
  EXPECT_EQ(read.counts().received, 1U);
  EXPECT_EQ(read.counts().wrong_length, 4U);
  EXPECT_EQ(read.counts().foreign_source, 1U);
  EXPECT_EQ(read.counts().fragments, 2U);
}

TEST(PcapReader, passes_over_frames_that_are_not_udp_or_cut_short) {
  Pcap pcap;
  pcap.add(ethernet_frame(data_payload(1), {.ether_type = 0x86DD}))
      .add(ethernet_frame(data_payload(1), {.protocol = 6}));
  const Bytes whole = ethernet_frame(data_payload(1), {.vlan_tags = 1});
  for (const std::size_t bytes : {0U, 1U, 13U, 15U, 17U, 37U, 45U})
    pcap.add(Bytes(whole.begin(), whole.begin() + static_cast<long>(bytes)));
  const Read read(pcap.bytes);
  EXPECT_TRUE(read.packets.empty());
  EXPECT_EQ(read.reader->other_frame_count(), 9U);
}

TEST(PcapReader, a_cut_off_last_record_is_an_end_with_a_warning) {
  Pcap pcap;
  for (std::uint8_t i = 0; i < 70; ++i) pcap.add(ethernet_frame(data_payload(i)));
  pcap.bytes.resize(pcap.bytes.size() - 500);
  const Read read(pcap.bytes);
  EXPECT_EQ(read.packets.size(), 69U);
  EXPECT_EQ(read.packets.back().bytes[1203], 68);
  EXPECT_EQ(read.result, ReadResult::end);
  EXPECT_EQ(read.error, "");
  EXPECT_THAT(std::string(read.reader->warning()),
              testing::AllOf(HasSubstr(read.file.path().string()), HasSubstr("cut off")));
}

TEST(PcapReader, damage_in_the_middle_fails_after_what_lies_before_it) {
  Pcap pcap;
  for (std::uint8_t i = 0; i < 10; ++i) pcap.add(ethernet_frame(data_payload(i)));
  const std::size_t record = 16 + ethernet_frame(data_payload(0)).size();
  for (std::size_t i = 0; i < 4; ++i) pcap.bytes[24 + 5 * record + 8 + i] = 0xFF;  // a record of 4 GB
  const Read read(pcap.bytes);
  EXPECT_EQ(read.packets.size(), 5U);
  EXPECT_EQ(read.result, ReadResult::failed);
  EXPECT_THAT(read.error, testing::AllOf(HasSubstr(read.file.path().string()), HasSubstr("damaged")));
}

Bytes gzip(const Bytes& plain) {
  Bytes packed(plain.size() + 1000);
  z_stream stream{};
  EXPECT_EQ(::deflateInit2(&stream, 6, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY), Z_OK);
  stream.next_in = const_cast<Bytef*>(plain.data());
  stream.avail_in = static_cast<uInt>(plain.size());
  stream.next_out = packed.data();
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(::deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  ::deflateEnd(&stream);
  return packed;
}

Bytes zstd(const Bytes& plain) {
  Bytes packed(ZSTD_compressBound(plain.size()));
  ZSTD_CCtx* const context = ZSTD_createCCtx();
  ZSTD_CCtx_setParameter(context, ZSTD_c_checksumFlag, 1);  // as the zstd program does
  packed.resize(ZSTD_compress2(context, packed.data(), packed.size(), plain.data(), plain.size()));
  ZSTD_freeCCtx(context);
  return packed;
}

/// 200 packets that do not shrink much.
Bytes noisy_capture() {
  Pcap pcap;
  std::uint32_t noise = 1;
  for (int i = 0; i < 200; ++i) {
    Bytes payload = data_payload(static_cast<std::uint8_t>(i));
    for (std::size_t at = 4; at < 1200; ++at)
      payload[at] = static_cast<std::uint8_t>((noise = noise * 69069 + 5) >> 24);
    pcap.add(ethernet_frame(payload));
  }
  return pcap.bytes;
}

TEST(PcapReader, reads_gzip_and_zstd_as_if_they_were_plain) {
  const Bytes plain = noisy_capture();
  const Read expected(plain);
  Bytes two_members = gzip(Bytes(plain.begin(), plain.begin() + 100'000));
  const Bytes second = gzip(Bytes(plain.begin() + 100'000, plain.end()));
  two_members.insert(two_members.end(), second.begin(), second.end());
  for (const Bytes& packed : {gzip(plain), zstd(plain), two_members}) {
    const Read read(packed);
    EXPECT_EQ(read.result, ReadResult::end) << read.error;
    EXPECT_EQ(read.reader->warning(), "");
    ASSERT_EQ(read.packets.size(), 200U);
    for (std::size_t i = 0; i < 200; ++i) EXPECT_EQ(read.packets[i].bytes, expected.packets[i].bytes);
  }
}

TEST(PcapReader, a_cut_off_compressed_capture_gives_what_is_there_and_warns) {
  for (Bytes packed : {gzip(noisy_capture()), zstd(noisy_capture())}) {
    packed.resize(packed.size() - packed.size() / 3);
    const Read read(packed);
    EXPECT_GT(read.packets.size(), 60U);
    EXPECT_LT(read.packets.size(), 200U);
    EXPECT_EQ(read.result, ReadResult::end) << read.error;
    EXPECT_THAT(std::string(read.reader->warning()), HasSubstr("cut off"));
  }
}

TEST(PcapReader, a_damaged_compressed_capture_is_named) {
  Bytes zipped = gzip(noisy_capture()), standard = zstd(noisy_capture());
  for (Bytes* packed : {&zipped, &standard}) {
    for (std::size_t at = packed->size() / 2; at < packed->size() / 2 + 64; ++at) (*packed)[at] ^= 0x5A;
    const Read read(*packed);
    EXPECT_EQ(read.result, ReadResult::failed);
    EXPECT_THAT(read.error, testing::AllOf(HasSubstr(read.file.path().string()), HasSubstr("damaged")));
  }
}

TEST(PcapReader, a_file_that_swells_without_end_is_refused) {
  Bytes bomb = Pcap().bytes;
  bomb.resize(24 << 20, 0);
  for (const Bytes& packed : {gzip(bomb), zstd(bomb)}) {
    ASSERT_LT(packed.size(), 200'000U);
    const Read read(packed);
    EXPECT_THAT(read.error, testing::AllOf(HasSubstr(read.file.path().string()), HasSubstr("250-fold")));
  }
}

void put_block(Bytes& file, std::uint32_t type, const Bytes& body) {
  const auto length = static_cast<std::uint32_t>(12 + (body.size() + 3) / 4 * 4);
  put_little(file, type);
  put_little(file, length);
  file.insert(file.end(), body.begin(), body.end());
  file.resize(file.size() + (4 - body.size() % 4) % 4, 0);
  put_little(file, length);
}

TEST(PcapReader, reads_pcapng_with_the_resolution_it_names) {
  Bytes section, interface, packet, file;
  put_little(section, 0x1A2B3C4D);
  put_little(section, 1, 2);
  put_little(section, 0, 2);
  section.resize(16, 0xFF);  // length not given
  put_little(interface, 1, 2);
  put_little(interface, 0, 2);
  put_little(interface, 65535);
  put_little(interface, 9, 2), put_little(interface, 1, 2), put_little(interface, 9);  // if_tsresol: nanoseconds
  put_little(interface, 0);
  const Bytes frame = ethernet_frame(data_payload(5));
  constexpr std::uint64_t kTime_ns = 1'700'000'000'123'456'789;
  put_little(packet, 0);
  put_little(packet, kTime_ns >> 32), put_little(packet, kTime_ns & 0xFFFFFFFF);
  put_little(packet, static_cast<std::uint32_t>(frame.size())),
      put_little(packet, static_cast<std::uint32_t>(frame.size()));
  packet.insert(packet.end(), frame.begin(), frame.end());
  put_block(file, 0x0A0D0D0A, section);
  put_block(file, 1, interface);
  put_block(file, 6, packet);
  for (const Bytes& bytes : {file, gzip(file)}) {
    const Read read(bytes);
    ASSERT_EQ(read.packets.size(), 1U) << read.error;
    EXPECT_EQ(read.packets[0].arrived.ns, static_cast<std::int64_t>(kTime_ns));
  }
}

TEST(PcapReader, reads_captures_of_a_bsd_loopback_in_either_byte_order) {
  const Bytes ethernet = ethernet_frame(data_payload(3));
  for (const Bytes& family : {Bytes{2, 0, 0, 0}, Bytes{0, 0, 0, 2}}) {
    Bytes frame = family;
    frame.insert(frame.end(), ethernet.begin() + 14, ethernet.end());
    EXPECT_EQ(Read(Pcap(0xA1B2C3D4, 0).add(frame).bytes).packets.size(), 1U);
    EXPECT_EQ(Read(Pcap(0xA1B2C3D4, 108).add(frame).bytes).packets.size(), 1U);
  }
  Bytes ipv6{30, 0, 0, 0};
  ipv6.insert(ipv6.end(), ethernet.begin() + 14, ethernet.end());
  EXPECT_TRUE(Read(Pcap(0xA1B2C3D4, 0).add(ipv6).bytes).packets.empty());
}

TEST(PcapReader, a_second_sensor_on_the_port_is_refused_until_one_is_named) {
  Pcap pcap;
  for (int i = 0; i < 5; ++i) pcap.add(ethernet_frame(data_payload(1)));
  pcap.add(ethernet_frame(data_payload(2), {.source = 0x0A000001}));
  pcap.add(ethernet_frame(data_payload(1)));
  const Read read(pcap.bytes);
  EXPECT_EQ(read.packets.size(), 5U);
  EXPECT_EQ(read.result, ReadResult::failed);
  EXPECT_THAT(read.error, testing::AllOf(HasSubstr("192.168.3.5, 10.0.0.1"), HasSubstr("lidar.source_address")));
  const Read one(pcap.bytes, {.source_ipv4 = 0x0A000001});
  EXPECT_EQ(one.packets.size(), 1U);
  EXPECT_EQ(one.result, ReadResult::end);
  EXPECT_EQ(one.counts().foreign_source, 6U);
}

TEST(PcapReader, a_capture_without_data_packets_says_what_it_holds_instead) {
  const Read wrong_port(Pcap().add(ethernet_frame(data_payload(1), {.port = 2369})).bytes);
  EXPECT_EQ(wrong_port.result, ReadResult::failed);
  EXPECT_THAT(wrong_port.error, testing::AllOf(HasSubstr("UDP port 2368"), HasSubstr("1 other frames")));
  const Read pieces(Pcap().add(ethernet_frame(data_payload(1), {.fragment_word = 0x2000})).bytes);
  EXPECT_THAT(pieces.error, testing::AllOf(HasSubstr("1 IP fragments"), HasSubstr("MTU")));
}

TEST(PcapReader, packets_cut_by_the_snap_length_are_named) {
  Pcap pcap;
  Bytes frame = ethernet_frame(data_payload(1));
  const auto whole = static_cast<std::uint32_t>(frame.size());
  frame.resize(96);
  pcap.add(frame);
  const std::size_t original_length_at = 24 + 12;
  for (std::size_t i = 0; i < 4; ++i) pcap.bytes[original_length_at + i] = static_cast<std::uint8_t>(whole >> (8 * i));
  const Read read(pcap.bytes);
  EXPECT_EQ(read.counts().cut_short, 1U);
  EXPECT_EQ(read.counts().wrong_length, 0U);
  EXPECT_THAT(read.error, testing::AllOf(HasSubstr("snap length"), HasSubstr("tcpdump -s 0")));
}

TEST(PcapReader, position_packets_come_with_the_data_and_only_of_their_length) {
  Pcap pcap;
  for (int i = 0; i < 40; ++i) {
    pcap.add(ethernet_frame(data_payload(1)));
    pcap.add(ethernet_frame(Bytes(512, static_cast<std::uint8_t>(i)), {.port = kPositionPort}));
  }
  pcap.add(ethernet_frame(Bytes(511, 0), {.port = kPositionPort}));
  pcap.add(ethernet_frame(Bytes(512, 0)));  // on the data port it is one of a wrong length
  const Read read(pcap.bytes);
  ASSERT_EQ(read.positions.size(), 40U);
  EXPECT_EQ(read.positions[39].bytes[511], 39);
  EXPECT_EQ(read.positions[0].arrived.ns, 100'000'250'000);
  EXPECT_EQ(read.packets.size(), 40U);
  EXPECT_EQ(read.counts().position_packets, 40U);
  EXPECT_EQ(read.counts().position_wrong_length, 1U);
  EXPECT_EQ(read.counts().wrong_length, 1U);
  EXPECT_TRUE(Read(pcap.bytes, {.position_port = 0}).positions.empty());
}

TEST(PcapReader, says_what_is_wrong_with_a_file_it_cannot_open) {
  LidarCounters counters;
  EXPECT_THAT(PcapReader::open("/nowhere/lidar.pcap", {}, counters).error().message,
              HasSubstr("/nowhere/lidar.pcap: no such file"));
  const TempFile text(std::string("this is not a capture at all, only text"));
  EXPECT_THAT(PcapReader::open(text.path(), {}, counters).error().message, HasSubstr("not a pcap"));
  const TempFile empty(std::string{});
  EXPECT_THAT(PcapReader::open(empty.path(), {}, counters).error().message, HasSubstr("not a pcap"));
  EXPECT_THAT(Read(Pcap(0xA1B2C3D4, 127).bytes).error, HasSubstr("link layer IEEE802_11_RADIO is not supported"));
}

TEST(PcapReader, gives_the_end_again_when_asked_again) {
  Read read(Pcap().add(ethernet_frame(data_payload(1))).bytes);
  std::span<const RawPacket> batch;
  EXPECT_EQ(read.reader->read(batch, {}), ReadResult::end);
  EXPECT_TRUE(batch.empty());
}

}  // namespace
}  // namespace roadvec
