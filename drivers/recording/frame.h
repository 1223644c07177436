#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace roadvec {

/// What lies around an IP packet in a capture.
enum class LinkLayer : std::uint8_t { ethernet, linux_cooked, linux_cooked2, raw_ip, loopback, socketcan };

/// A UDP datagram inside a captured frame.
struct UdpDatagram {
  std::uint32_t source_ipv4 = 0;  ///< host byte order
  std::uint16_t destination_port = 0;
  std::size_t length = 0;                 ///< of the payload as sent
  std::span<const std::uint8_t> payload;  ///< as captured: shorter than `length` when the capture cut the frame
};

struct CapturedFrame {
  std::optional<UdpDatagram> datagram;  ///< empty: not IPv4 UDP, damaged, or a fragment
  bool fragment = false;                ///< part of an IPv4 UDP datagram that was split; these are not put together
};

/// Takes any bytes. Skips VLAN tags (802.1Q, 802.1ad, QinQ) and IP options.
[[nodiscard]] CapturedFrame parse_frame(LinkLayer link, std::span<const std::uint8_t> frame) noexcept;

}  // namespace roadvec
