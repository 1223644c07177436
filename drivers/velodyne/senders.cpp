#include "drivers/velodyne/senders.h"

namespace roadvec {

std::string ipv4_text(std::uint32_t address) {
  std::string text;
  for (int shift = 24; shift >= 0; shift -= 8) {
    text += std::to_string(address >> shift & 0xFF);
    if (shift > 0) text += '.';
  }
  return text;
}

void Senders::note(std::uint32_t address) noexcept {
  for (std::atomic<std::uint32_t>& place : seen_) {
    const std::uint32_t there = place.load(std::memory_order_relaxed);
    if (there == 0) place.store(address, std::memory_order_relaxed);
    if (there == 0 || there == address) return;
  }
}

std::size_t Senders::count() const noexcept {
  std::size_t count = 0;
  while (count < kMost && seen_[count].load(std::memory_order_relaxed) != 0) ++count;
  return count;
}

std::string Senders::list() const {
  std::string text;
  for (std::size_t i = 0, end = count(); i < end; ++i) {
    text += (i > 0 ? ", " : "") + ipv4_text(seen_[i].load(std::memory_order_relaxed));
  }
  return text;
}

}  // namespace roadvec
