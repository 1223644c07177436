#include "tools/recording/xsens_message.h"

#include <bit>
#include <initializer_list>
#include <vector>

#include "tools/recording/output_file.h"

namespace roadvec {
namespace {

/// One MTData2 message being put together, big endian throughout.
class Message {
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

}  // namespace

std::string xsens_message(std::uint64_t tick, const ImuReading& reading) {
  const Eigen::Quaterniond& q = reading.orientation;
  const Eigen::Vector3d &a = reading.force_mps2, &w = reading.rate_radps;
  Message message;
  message.datum(0x1020, 2);
  message.put(static_cast<std::uint32_t>(tick & 0xFFFF), 2);
  message.datum(0x1060, 4);
  message.put(static_cast<std::uint32_t>(tick * 100), 4);  // SampleTimeFine counts 0.1 ms
  message.floats(0x2010, {q.w(), q.x(), q.y(), q.z()});
  message.floats(0x4020, {a.x(), a.y(), a.z()});
  message.floats(0x8020, {w.x(), w.y(), w.z()});
  message.datum(0xE020, 4);
  message.put(3, 4);
  return message.hex();
}

}  // namespace roadvec
