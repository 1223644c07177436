#include "drivers/velodyne/pcap_reader.h"

#include <pcap/pcap.h>

#include <algorithm>
#include <array>

namespace roadvec {
namespace {

std::optional<LinkLayer> link_layer_of(int data_link) {
  switch (data_link) {
    case DLT_EN10MB:
      return LinkLayer::ethernet;
    case DLT_LINUX_SLL:
      return LinkLayer::linux_cooked;
    case DLT_LINUX_SLL2:
      return LinkLayer::linux_cooked2;
    case DLT_RAW:
    case DLT_IPV4:
      return LinkLayer::raw_ip;
    default:
      return std::nullopt;
  }
}

/// Seconds are clamped to the years 1970 to 2242, so that no later difference of two times can overflow.
SensorTime time_of(const pcap_pkthdr& header) {
  const auto seconds = std::clamp<std::int64_t>(header.ts.tv_sec, 0, std::int64_t{1} << 33);
  const auto nanoseconds =
      std::clamp<std::int64_t>(header.ts.tv_usec, 0, 999'999'999);  // libpcap was asked for nanoseconds
  return {seconds * 1'000'000'000 + nanoseconds};
}

}  // namespace

Expected<std::unique_ptr<PcapReader>> PcapReader::open(const std::filesystem::path& path,
                                                       const PcapReaderOptions& options, LidarCounters& counters) {
  std::array<char, PCAP_ERRBUF_SIZE> why{};
  pcap* const file = pcap_open_offline_with_tstamp_precision(path.c_str(), PCAP_TSTAMP_PRECISION_NANO, why.data());
  if (file == nullptr) {
    std::error_code ignored;
    if (!std::filesystem::exists(path, ignored)) return fail(path.string() + ": no such file; check the path");
    return fail(path.string() + ": not a pcap that can be read (" + why.data() +
                "); capture with tcpdump or Wireshark");
  }
  const std::optional<LinkLayer> link = link_layer_of(pcap_datalink(file));
  if (!link) {
    const char* const name = pcap_datalink_val_to_name(pcap_datalink(file));
    const std::string layer = name != nullptr ? name : std::to_string(pcap_datalink(file));
    pcap_close(file);
    return fail(path.string() + ": link layer " + layer + " is not supported; capture on an Ethernet interface");
  }
  return std::unique_ptr<PcapReader>(new PcapReader(file, *link, path.string(), options, counters));
}

PcapReader::PcapReader(pcap* file, LinkLayer link, std::string name, const PcapReaderOptions& options,
                       LidarCounters& counters)
    : file_(file),
      link_(link),
      name_(std::move(name)),
      options_(options),
      counters_(counters),
      packets_(kBatchPackets) {}

PcapReader::~PcapReader() { pcap_close(file_); }

ReadResult PcapReader::read(std::span<const RawPacket>& batch, std::chrono::milliseconds) noexcept {
  std::size_t count = 0;
  while (count < packets_.size() && !finished_) {
    pcap_pkthdr* header = nullptr;
    const u_char* bytes = nullptr;
    const int result = pcap_next_ex(file_, &header, &bytes);
    if (result == 1) {
      if (take(parse_frame(link_, {bytes, header->caplen}), time_of(*header), packets_[count])) ++count;
    } else if (result == PCAP_ERROR_BREAK) {
      finished_ = ReadResult::end;
    } else {
      error_ = name_ + ": damaged or cut off (" + pcap_geterr(file_) + "); what lies before was read";
      finished_ = ReadResult::failed;
    }
  }
  batch = {packets_.data(), count};
  return count > 0 ? ReadResult::packets : finished_.value_or(ReadResult::quiet);
}

/// False: not a data packet of our sensor (counted).
bool PcapReader::take(const CapturedFrame& frame, SensorTime arrived, RawPacket& packet) noexcept {
  if (!frame.datagram) {
    ++(frame.fragment ? fragment_count_ : other_frame_count_);
    return false;
  }
  const UdpDatagram& datagram = *frame.datagram;
  if (options_.port != 0 && datagram.destination_port != options_.port) {
    ++(datagram.destination_port == kPositionPort ? position_packet_count_ : other_frame_count_);
    return false;
  }
  if (options_.port == 0 && datagram.length != kPacketBytes) {
    ++(datagram.length == kPositionPacketBytes ? position_packet_count_ : other_frame_count_);
    return false;
  }
  if (options_.source_ipv4 && datagram.source_ipv4 != *options_.source_ipv4) {
    counters_.foreign_source.add();
    return false;
  }
  if (datagram.payload.size() != kPacketBytes || datagram.length != kPacketBytes) {
    counters_.wrong_length.add();
    return false;
  }
  counters_.received.add();
  packet.arrived = arrived;
  packet.source_ipv4 = datagram.source_ipv4;
  std::copy(datagram.payload.begin(), datagram.payload.end(), packet.bytes.begin());
  return true;
}

}  // namespace roadvec
