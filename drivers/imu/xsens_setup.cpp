#include "drivers/imu/xsens_setup.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "drivers/imu/mtdata2.h"
#include "drivers/imu/serial_port.h"

namespace roadvec {
namespace {

using Clock = std::chrono::steady_clock;
using Bytes = std::vector<std::uint8_t>;

// A request's answer has the next number. [XsensMT0605P]
constexpr std::uint8_t kReqDeviceId = 0x00, kGoToMeasurement = 0x10, kReqFirmware = 0x12, kReqProductCode = 0x1C,
                       kGoToConfig = 0x30, kOutputConfiguration = 0xC0;
constexpr std::uint16_t kEveryMessage = 0xFFFF;
constexpr int kTries = 4;

constexpr auto kDefaultOutputs = std::to_array<XsensOutput>({{0x1020, kEveryMessage},
                                                             {0x1060, kEveryMessage},
                                                             {0x2010, 100},
                                                             {0x4020, 100},
                                                             {0x8020, 100},
                                                             {0xE020, kEveryMessage}});

/// Requests and answers on an open line.
class Dialogue {
 public:
  Dialogue(std::string path, int fd, std::chrono::milliseconds patience)
      : path_(std::move(path)), fd_(fd), patience_(patience) {}
  ~Dialogue() { ::close(fd_); }
  Dialogue(const Dialogue&) = delete;
  Dialogue& operator=(const Dialogue&) = delete;

  /// The answer's content. Asked again if none comes: a request that arrives amid the measurements may be lost.
  Expected<Bytes> ask(std::uint8_t request, const Bytes& content, const char* what) {
    for (int i = 0; i < kTries; ++i) {
      if (!send(request, content)) break;
      Bytes answer;
      const std::uint8_t kind = receive(static_cast<std::uint8_t>(request + 1), answer);
      if (kind == kXsensDeviceError) {
        return fail_at(what, "the device refuses with error code " +
                                 std::to_string(answer.empty() ? 0 : answer.front()) + " of its manual");
      }
      if (kind != 0) return answer;
    }
    return fail_at(what, "no answer; is it an Xsens MTi, and imu.baud its speed?");
  }

  [[nodiscard]] tl::unexpected<Error> fail_at(const std::string& what, const std::string& why) const {
    return fail("cannot set up the IMU on " + path_ + " (" + what + "): " + why);
  }

 private:
  bool send(std::uint8_t kind, const Bytes& content) {
    Bytes message{0xFA, 0xFF, kind, static_cast<std::uint8_t>(content.size())};
    message.insert(message.end(), content.begin(), content.end());
    unsigned sum = 0;
    for (std::size_t i = 1; i < message.size(); ++i) sum += message[i];
    message.push_back(static_cast<std::uint8_t>(0x100 - (sum & 0xFF)));
    return ::write(fd_, message.data(), message.size()) == static_cast<ssize_t>(message.size());
  }

  /// `wanted`, or the device's error, or 0 when patience ran out.
  std::uint8_t receive(std::uint8_t wanted, Bytes& content) {
    const Clock::time_point until = Clock::now() + patience_;
    for (;;) {
      XbusMessage message;
      const XbusFront front = read_xbus(received_, message);
      if (front == XbusFront::message) {
        const std::uint8_t kind = message.kind;
        content.assign(message.content.begin(), message.content.end());
        drop(message.byte_count);
        if (kind == wanted || kind == kXsensDeviceError) return kind;
      } else if (front != XbusFront::incomplete) {
        drop(1);
      } else if (!read_more(until)) {
        return 0;
      }
    }
  }

  void drop(std::size_t count) { received_.erase(received_.begin(), received_.begin() + static_cast<long>(count)); }

  bool read_more(Clock::time_point until) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - Clock::now());
    pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
    if (left.count() <= 0 || ::poll(&waiting, 1, static_cast<int>(left.count())) <= 0) return false;
    std::array<std::uint8_t, 1024> bytes{};
    const ssize_t count = ::read(fd_, bytes.data(), bytes.size());
    if (count > 0) received_.insert(received_.end(), bytes.begin(), bytes.begin() + count);
    return count > 0 || errno == EAGAIN || errno == EINTR;
  }

  std::string path_;
  int fd_;
  std::chrono::milliseconds patience_;
  Bytes received_;
};

Bytes content_of(std::span<const XsensOutput> outputs) {
  Bytes bytes;
  for (const XsensOutput& output : outputs) {
    for (const std::uint16_t word : {output.data_id, output.rate_hz}) {
      bytes.push_back(static_cast<std::uint8_t>(word >> 8));
      bytes.push_back(static_cast<std::uint8_t>(word));
    }
  }
  return bytes;
}

std::vector<XsensOutput> outputs_of(const Bytes& bytes) {
  std::vector<XsensOutput> outputs;
  for (std::size_t i = 0; i + 4 <= bytes.size(); i += 4) {
    outputs.push_back({static_cast<std::uint16_t>(bytes[i] << 8 | bytes[i + 1]),
                       static_cast<std::uint16_t>(bytes[i + 2] << 8 | bytes[i + 3])});
  }
  return outputs;
}

std::string text_of(const XsensOutput& output) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), output.rate_hz == kEveryMessage ? "%04X" : "%04X@%u", output.data_id,
                output.rate_hz);
  return text.data();
}

Expected<XsensDevice> describe(Dialogue& dialogue) {
  XsensDevice device;
  const Expected<Bytes> id = dialogue.ask(kReqDeviceId, {}, "device id");
  if (!id) return tl::unexpected(id.error());
  for (const std::uint8_t byte : *id) device.device_id = device.device_id << 8 | byte;
  const Expected<Bytes> product = dialogue.ask(kReqProductCode, {}, "product code");
  if (!product) return tl::unexpected(product.error());
  std::copy_if(product->begin(), product->end(), std::back_inserter(device.product),
               [](std::uint8_t c) { return c > ' ' && c < 0x7F; });
  const Expected<Bytes> firmware = dialogue.ask(kReqFirmware, {}, "firmware");
  if (!firmware) return tl::unexpected(firmware.error());
  for (std::size_t i = 0; i < std::min<std::size_t>(firmware->size(), 3); ++i) {
    device.firmware += (i > 0 ? "." : "") + std::to_string((*firmware)[i]);
  }
  return device;
}

}  // namespace

std::span<const XsensOutput> default_xsens_outputs() noexcept { return kDefaultOutputs; }

std::string XsensDevice::text() const {
  std::string text = product + ", firmware " + firmware + ", sends";
  for (const XsensOutput& output : outputs) text += " " + text_of(output);
  return text;
}

Expected<XsensDevice> set_up_xsens(const std::string& path, unsigned baud, std::span<const XsensOutput> outputs,
                                   std::chrono::milliseconds patience) {
  const Expected<int> fd = open_serial(path, baud, SerialUse::read_and_write);
  if (!fd) return tl::unexpected(fd.error());
  Dialogue dialogue(path, *fd, patience);
  if (const auto stopped = dialogue.ask(kGoToConfig, {}, "stop measuring"); !stopped)
    return tl::unexpected(stopped.error());
  Expected<XsensDevice> device = describe(dialogue);
  if (!device) return device;
  if (const auto set = dialogue.ask(kOutputConfiguration, content_of(outputs), "set the outputs"); !set)
    return tl::unexpected(set.error());
  const Expected<Bytes> made = dialogue.ask(kOutputConfiguration, {}, "read the outputs back");
  if (!made) return tl::unexpected(made.error());
  device->outputs = outputs_of(*made);
  for (const XsensOutput& output : outputs) {
    if (std::find(device->outputs.begin(), device->outputs.end(), output) == device->outputs.end()) {
      return dialogue.fail_at("read the outputs back",
                              "it does not send " + text_of(output) + "; it is a " + device->text());
    }
  }
  if (const auto started = dialogue.ask(kGoToMeasurement, {}, "measure again"); !started)
    return tl::unexpected(started.error());
  return device;
}

}  // namespace roadvec
