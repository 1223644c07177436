#pragma once

#include <bit>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <vector>

#include "tools/recording/output_file.h"

namespace roadvec {

/// One MTData2 message being put together, big endian throughout.
class XsensMessage {
 public:
  void datum(unsigned id, unsigned size) { put(id << 8 | size, 3); }
  void put(std::uint32_t value, int count) {
    for (int i = count; i-- > 0;) data_.push_back(static_cast<std::uint8_t>(value >> 8 * i & 0xFF));
  }
  void floats(unsigned id, std::initializer_list<double> values) {
    datum(id, static_cast<unsigned>(4 * values.size()));
    for (const double value : values) put(std::bit_cast<std::uint32_t>(static_cast<float>(value)), 4);
  }
  [[nodiscard]] std::string hex() const {
    std::string text = print("faff36%02x", static_cast<unsigned>(data_.size()));
    unsigned sum = 0xFF + 0x36 + static_cast<unsigned>(data_.size());
    for (const std::uint8_t byte : data_) {
      text += print("%02x", byte);
      sum += byte;
    }
    return text + print("%02x", -sum & 0xFF);
  }

 private:
  std::vector<std::uint8_t> data_;
};

}  // namespace roadvec
