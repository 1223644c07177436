#include "drivers/recording/frame.h"

#include <algorithm>

namespace roadvec {
namespace {

using Bytes = std::span<const std::uint8_t>;
constexpr std::uint16_t kEtherIpv4 = 0x0800, kEtherVlan = 0x8100, kEtherServiceVlan = 0x88A8,
                        kEtherOldServiceVlan = 0x9100;
constexpr std::uint8_t kProtocolUdp = 17, kFamilyIpv4 = 2;
constexpr std::size_t kUdpHeaderBytes = 8;

std::uint16_t big_u16(Bytes bytes, std::size_t at) {
  return static_cast<std::uint16_t>(bytes[at] << 8 | bytes[at + 1]);
}

/// What follows the link's header, if that is IPv4.
Bytes ip_packet(LinkLayer link, Bytes frame) {
  if (link == LinkLayer::raw_ip) return frame;
  if (link == LinkLayer::socketcan) return {};
  if (link == LinkLayer::loopback) {
    // The family in four bytes, in the byte order of the host that captured (BSD NULL) or in the network's (LOOP).
    if (frame.size() < 4 || (frame[0] != kFamilyIpv4 && frame[3] != kFamilyIpv4)) return {};
    return frame.subspan(4);
  }
  std::size_t type_at = 12, header_bytes = 14;
  if (link == LinkLayer::linux_cooked) type_at = 14, header_bytes = 16;
  if (link == LinkLayer::linux_cooked2) type_at = 0, header_bytes = 20;
  if (frame.size() < header_bytes) return {};
  std::uint16_t type = big_u16(frame, type_at);
  frame = frame.subspan(header_bytes);
  while (type == kEtherVlan || type == kEtherServiceVlan || type == kEtherOldServiceVlan) {
    if (frame.size() < 4) return {};
    type = big_u16(frame, 2);
    frame = frame.subspan(4);
  }
  return type == kEtherIpv4 ? frame : Bytes{};
}

}  // namespace

CapturedFrame parse_frame(LinkLayer link, Bytes frame) noexcept {
  const Bytes ip = ip_packet(link, frame);
  if (ip.size() < 20 || ip[0] >> 4 != 4 || ip[9] != kProtocolUdp) return {};
  const std::size_t header_bytes = static_cast<std::size_t>(ip[0] & 0x0F) * 4;
  const std::size_t total_bytes = big_u16(ip, 2);
  constexpr std::uint16_t kMoreFragmentsOrOffset = 0x3FFF;
  if ((big_u16(ip, 6) & kMoreFragmentsOrOffset) != 0) return {.datagram = std::nullopt, .fragment = true};
  if (header_bytes < 20 || total_bytes < header_bytes + kUdpHeaderBytes || ip.size() < header_bytes + kUdpHeaderBytes)
    return {};

  const Bytes udp = ip.subspan(header_bytes);
  const std::size_t udp_bytes = big_u16(udp, 4);
  if (udp_bytes < kUdpHeaderBytes || udp_bytes > total_bytes - header_bytes) return {};
  UdpDatagram datagram;
  datagram.source_ipv4 = static_cast<std::uint32_t>(big_u16(ip, 12)) << 16 | big_u16(ip, 14);
  datagram.destination_port = big_u16(udp, 2);
  datagram.length = udp_bytes - kUdpHeaderBytes;
  // Short frames are padded on the wire: the UDP length says what belongs to the datagram.
  datagram.payload = udp.subspan(kUdpHeaderBytes, std::min(datagram.length, udp.size() - kUdpHeaderBytes));
  return {.datagram = datagram, .fragment = false};
}

}  // namespace roadvec
