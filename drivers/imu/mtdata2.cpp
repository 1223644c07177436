#include "drivers/imu/mtdata2.h"

#include <algorithm>
#include <bit>

namespace roadvec {
namespace {

constexpr std::uint8_t kPreamble = 0xFA;
constexpr std::uint8_t kMaster = 0xFF;
constexpr std::uint8_t kMtData2 = 0x36;
constexpr std::uint8_t kExtendedLength = 0xFF;

// Data ids, with the bits for precision and frame cleared. [XsensMT0605P, MTData2 packet]
constexpr unsigned kTypeMask = 0xFFF0;
enum DataId : unsigned {
  kTemperature = 0x0810,
  kUtcTime = 0x1010,
  kPacketCounter = 0x1020,
  kSampleTimeFine = 0x1060,
  kSampleTimeCoarse = 0x1070,
  kQuaternion = 0x2010,
  kRotationMatrix = 0x2020,
  kEulerAngles = 0x2030,
  kPressure = 0x3010,
  kDeltaV = 0x4010,
  kAcceleration = 0x4020,
  kFreeAcceleration = 0x4030,
  kAccelerationHr = 0x4040,
  kAltitude = 0x5020,
  kPositionEcef = 0x5030,
  kLatitudeLongitude = 0x5040,
  kRateOfTurn = 0x8020,
  kDeltaQ = 0x8030,
  kRateOfTurnHr = 0x8040,
  kMagneticField = 0xC020,
  kVelocity = 0xD010,
  kStatusByte = 0xE010,
  kStatusWord = 0xE020,
};

constexpr std::array<std::size_t, 4> kBytesOfPrecision = {4, 4, 6, 8};  // float32, 12.20, 16.32, float64

std::uint64_t big_endian(std::span<const std::uint8_t> bytes) {
  std::uint64_t value = 0;
  for (const std::uint8_t byte : bytes) value = value << 8 | byte;
  return value;
}

double number(std::span<const std::uint8_t> bytes, unsigned precision) {
  const std::uint64_t bits = big_endian(bytes);
  switch (precision) {
    case 0:
      return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
    case 1:
      return static_cast<double>(static_cast<std::int32_t>(static_cast<std::uint32_t>(bits))) / 1048576.0;
    case 2: {
      // The fraction's four bytes come first, the whole part's two behind them.
      const auto whole = static_cast<std::int16_t>(static_cast<std::uint16_t>(bits));
      return static_cast<double>(whole) + static_cast<double>(bits >> 16) / 4294967296.0;
    }
    default:
      return std::bit_cast<double>(bits);
  }
}

template <std::size_t N>
bool read_vector(std::span<const std::uint8_t> data, unsigned precision, std::array<double, N>& vector) {
  const std::size_t size = kBytesOfPrecision[precision];
  if (data.size() != N * size) return false;
  for (std::size_t i = 0; i < N; ++i) vector[i] = number(data.subspan(i * size, size), precision);
  return true;
}

template <class Integer>
bool read_integer(std::span<const std::uint8_t> data, std::size_t size, Integer& value) {
  if (data.size() != size) return false;
  value = static_cast<Integer>(big_endian(data));
  return true;
}

template <std::size_t N>
bool read_vector(std::span<const std::uint8_t> data, unsigned precision, std::optional<std::array<double, N>>& vector) {
  std::array<double, N> values;
  if (!read_vector(data, precision, values)) return false;
  vector = values;
  return true;
}

bool read_utc(std::span<const std::uint8_t> data, std::optional<XsensUtc>& utc) {
  if (data.size() != 12) return false;
  utc = XsensUtc{static_cast<std::uint32_t>(big_endian(data.first(4))),
                 static_cast<std::uint16_t>(big_endian(data.subspan(4, 2))),
                 data[6],
                 data[7],
                 data[8],
                 data[9],
                 data[10],
                 data[11]};
  return true;
}

bool read_pressure(std::span<const std::uint8_t> data, std::optional<std::uint32_t>& pressure_pa) {
  if (data.size() != 4) return false;
  pressure_pa = static_cast<std::uint32_t>(big_endian(data));
  return true;
}

bool read_frame(unsigned id, XsensFrame& frame) {
  const unsigned bits = id & 0xC;
  if (bits == 0xC) return false;
  frame = static_cast<XsensFrame>(bits);
  return true;
}

/// False: the item is not as its id says.
bool read_item(unsigned id, std::span<const std::uint8_t> data, XsensSample& sample) {
  const unsigned precision = id & 3;
  switch (id & kTypeMask) {
    case kPacketCounter:
      return sample.has_packet_counter = read_integer(data, 2, sample.packet_counter);
    case kSampleTimeFine:
      return sample.has_time_fine = read_integer(data, 4, sample.time_fine);
    case kSampleTimeCoarse:
      return sample.has_time_coarse = read_integer(data, 4, sample.time_coarse_s);
    case kStatusByte:
      // The word begins with the byte's bits and says more: it wins when a device sends both.
      if (sample.has_status) return data.size() == 1;
      return sample.has_status = read_integer(data, 1, sample.status);
    case kStatusWord:
      return sample.has_status = read_integer(data, 4, sample.status);
    case kAcceleration:
      return sample.has_acceleration = read_vector(data, precision, sample.acceleration_mps2);
    case kRateOfTurn:
      return sample.has_rate = read_vector(data, precision, sample.rate_radps);
    case kAccelerationHr:
      return read_vector(data, precision, sample.acceleration_hr_mps2);
    case kRateOfTurnHr:
      return read_vector(data, precision, sample.rate_hr_radps);
    case kDeltaV:
      return read_vector(data, precision, sample.delta_v_mps);
    case kDeltaQ:
      return read_vector(data, precision, sample.delta_q);
    case kFreeAcceleration:
      return read_vector(data, precision, sample.free_acceleration_mps2);
    case kMagneticField:
      return read_vector(data, precision, sample.magnetic_field);
    case kVelocity:
      return read_vector(data, precision, sample.velocity_mps);
    case kPositionEcef:
      return read_vector(data, precision, sample.ecef_m);
    case kLatitudeLongitude:
      return read_vector(data, precision, sample.latitude_longitude_deg);
    case kTemperature:
      return read_vector(data, precision, sample.temperature_c);
    case kAltitude:
      return read_vector(data, precision, sample.altitude_m);
    case kPressure:
      return read_pressure(data, sample.pressure_pa);
    case kUtcTime:
      return read_utc(data, sample.utc);
    case kRotationMatrix:
      return sample.has_matrix = read_vector(data, precision, sample.matrix) && read_frame(id, sample.frame);
    case kQuaternion:
      return sample.has_quaternion = read_vector(data, precision, sample.quaternion) && read_frame(id, sample.frame);
    case kEulerAngles:
      return sample.has_euler = read_vector(data, precision, sample.euler_deg) && read_frame(id, sample.frame);
    default:
      return true;
  }
}

}  // namespace

std::size_t parse_mtdata2(std::span<const std::uint8_t> content, XsensSample& sample) noexcept {
  std::size_t malformed = 0;
  sample = {};
  while (!content.empty()) {
    constexpr std::size_t kItemHeader = 3;
    if (content.size() < kItemHeader || content.size() - kItemHeader < content[2]) return malformed + 1;
    const auto id = static_cast<unsigned>(big_endian(content.first(2)));
    if (!read_item(id, content.subspan(kItemHeader, content[2]), sample)) ++malformed;
    content = content.subspan(kItemHeader + content[2]);
  }
  return malformed;
}

XbusFront read_xbus(std::span<const std::uint8_t> bytes, XbusMessage& message) noexcept {
  if (bytes.empty()) return XbusFront::incomplete;
  if (bytes[0] != kPreamble) return XbusFront::noise;
  if (bytes.size() >= 2 && bytes[1] != kMaster) return XbusFront::noise;
  if (bytes.size() < 4) return XbusFront::incomplete;
  std::size_t header = 4;
  std::size_t length = bytes[3];
  if (length == kExtendedLength) {
    header = 6;
    if (bytes.size() < header) return XbusFront::incomplete;
    length = static_cast<std::size_t>(big_endian(bytes.subspan(4, 2)));
    if (header + length + 1 > kMaxXbusBytes) return XbusFront::noise;
  }
  if (bytes.size() < header + length + 1) return XbusFront::incomplete;
  unsigned sum = 0;
  for (const std::uint8_t byte : bytes.subspan(1, header + length)) sum += byte;
  if ((sum & 0xFF) != 0) return XbusFront::bad_checksum;
  message = {bytes[2], bytes.subspan(header, length), header + length + 1};
  return XbusFront::message;
}

bool Mtdata2Parser::next(std::span<const std::uint8_t>& bytes, XsensSample& sample) noexcept {
  for (;;) {
    XbusMessage message;
    switch (read_xbus(std::span(buffer_).subspan(begin_, end_ - begin_), message)) {
      case XbusFront::incomplete: {
        if (bytes.empty()) return false;
        std::move(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_),
                  buffer_.begin() + static_cast<std::ptrdiff_t>(end_), buffer_.begin());
        end_ -= begin_;
        begin_ = 0;
        const std::size_t count = std::min(bytes.size(), buffer_.size() - end_);
        std::copy_n(bytes.begin(), count, buffer_.begin() + static_cast<std::ptrdiff_t>(end_));
        end_ += count;
        bytes = bytes.subspan(count);
        break;
      }
      case XbusFront::bad_checksum:
        ++counters_.bad_checksum_count;
        [[fallthrough]];
      case XbusFront::noise:
        ++counters_.skipped_byte_count;
        ++begin_;
        break;
      case XbusFront::message: {
        begin_ += message.byte_count;
        if (message.kind == kMtData2) {
          ++counters_.message_count;
          counters_.malformed_item_count += parse_mtdata2(message.content, sample);
          count_lost(sample);
          return true;
        }
        ++counters_.other_message_count;
        if (message.kind == kXsensDeviceError) ++counters_.device_error_count;
        break;
      }
    }
  }
}

void Mtdata2Parser::count_lost(const XsensSample& sample) noexcept {
  if (!sample.has_packet_counter) return;
  // 65536 counts make a turn: the difference is right across it. A device that starts anew is not a loss of thousands.
  constexpr std::uint16_t kLargestGap = 1000;
  const auto step = static_cast<std::uint16_t>(sample.packet_counter - last_packet_);
  if (has_last_packet_ && step > 1 && step <= kLargestGap) counters_.lost_message_count += step - 1u;
  last_packet_ = sample.packet_counter;
  has_last_packet_ = true;
}

}  // namespace roadvec
