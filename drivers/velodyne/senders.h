#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>
#include <string>

namespace roadvec {

[[nodiscard]] std::string ipv4_text(std::uint32_t address);  ///< "192.168.1.201"

/// Who sends data packets to our port, and whose are taken: the configured sensor's, or those of the first that sends.
/// Packets of two heads in one sweep would make a map of nothing. Written by the lidar thread, read by any.
class Senders {
 public:
  static constexpr std::size_t kMost = 8;  ///< more are not told apart

  explicit Senders(std::optional<std::uint32_t> wanted) : wanted_(wanted) {}

  /// One data packet came from `address` (not 0); true: it is of our sensor.
  [[nodiscard]] bool take(std::uint32_t address) noexcept {
    note(address);
    return address == wanted_.value_or(seen_[0].load(std::memory_order_relaxed));
  }
  /// It would be; nothing is noted. For what is no data packet.
  [[nodiscard]] bool ours(std::uint32_t address) const noexcept {
    const std::uint32_t first = seen_[0].load(std::memory_order_relaxed);
    return wanted_ ? address == *wanted_ : first == 0 || address == first;
  }
  [[nodiscard]] std::size_t count() const noexcept;
  /// More than one sends, and nobody said which is meant.
  [[nodiscard]] bool ambiguous() const noexcept { return !wanted_ && count() > 1; }
  [[nodiscard]] std::string list() const;  ///< "192.168.1.201, 192.168.1.202", in order of appearance

 private:
  void note(std::uint32_t address) noexcept;
  std::optional<std::uint32_t> wanted_;
  // Relaxed: each is written once, and orders nothing else.
  std::array<std::atomic<std::uint32_t>, kMost> seen_{};
};

}  // namespace roadvec
