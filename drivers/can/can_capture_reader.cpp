#include "drivers/can/can_capture_reader.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <system_error>
#include <utility>

#include "drivers/can/can_log_reader.h"

namespace roadvec {
namespace {

// A record of CAN_SOCKETCAN: identifier and flags (4 bytes, big endian), length, FD flags, two bytes of nothing, data.
// [tcpdump.org, LINKTYPE_CAN_SOCKETCAN]
constexpr std::size_t kHeaderBytes = 8, kLengthOffset = 4, kFdFlagsOffset = 5;
constexpr std::uint32_t kExtended = 0x80000000, kRemote = 0x40000000, kError = 0x20000000;
constexpr std::uint8_t kFdFrame = 0x04;
constexpr std::size_t kClassicBytes = 8;

/// False: the record holds no whole frame.
bool unpack(std::span<const std::uint8_t> record, CanFrame& frame) noexcept {
  if (record.size() < kHeaderBytes) return false;
  std::uint32_t id = 0;
  for (std::size_t i = 0; i < 4; ++i) id = id << 8 | record[i];
  const std::size_t length = record[kLengthOffset];
  frame.fd = (record[kFdFlagsOffset] & kFdFrame) != 0 || length > kClassicBytes;
  frame.extended = (id & kExtended) != 0;
  frame.remote = (id & kRemote) != 0;
  frame.error = (id & kError) != 0;
  frame.id = id & (frame.extended || frame.error ? kExtendedCanIdMask : kStandardCanIdMask);
  const std::span<const std::uint8_t> data = record.subspan(kHeaderBytes);
  if (length > kMaxCanBytes || (!frame.remote && data.size() < length)) return false;
  frame.length = static_cast<std::uint8_t>(length);
  frame.interface = 0;
  frame.data = {};
  std::copy_n(data.begin(), std::min(length, data.size()), frame.data.begin());
  return true;
}

bool is_capture(const std::string& path) {
  constexpr std::string_view kBegins[] = {"\xD4\xC3\xB2\xA1", "\xA1\xB2\xC3\xD4", "\x4D\x3C\xB2\xA1",
                                          "\xA1\xB2\x3C\x4D", "\x0A\x0D\x0D\x0A", "\x28\xB5\x2F\xFD",
                                          "\x1F\x8B"};  // pcap in four ways, pcapng, zstd, gzip
  if (std::error_code ignored; !std::filesystem::is_regular_file(path, ignored)) return false;
  char begin[4] = {};
  std::ifstream(path, std::ios::binary).read(begin, sizeof begin);
  const std::string_view bytes(begin, sizeof begin);
  return std::any_of(std::begin(kBegins), std::end(kBegins), [bytes](auto magic) { return bytes.starts_with(magic); });
}

}  // namespace

Expected<std::unique_ptr<CanCaptureReader>> CanCaptureReader::open(const std::string& path, std::int64_t offset_ns) {
  Expected<CaptureFile> file = CaptureFile::open(path);
  if (!file) return tl::unexpected(file.error());
  if (file->link() != LinkLayer::socketcan) {
    return fail(path + ": a capture, but not of a CAN interface; record with tcpdump -i can0 -w FILE, or candump -l");
  }
  return std::unique_ptr<CanCaptureReader>(new CanCaptureReader(*std::move(file), offset_ns));
}

CanReadResult CanCaptureReader::read(CanFrame& frame, std::chrono::milliseconds) noexcept {
  for (;;) {
    CaptureFile::Frame record;
    const CaptureFile::Next next = file_.next(record);
    if (next == CaptureFile::Next::failed) return CanReadResult::failed;
    if (next != CaptureFile::Next::frame) return CanReadResult::end;
    if (!unpack(record.bytes, frame)) {
      ++counters_.wrong_size_count;
      continue;
    }
    frame.time = record.time + offset_ns_;
    ++counters_.frame_count;
    if (frame.error) count_error_frame(frame, counters_);
    return CanReadResult::frame;
  }
}

Expected<std::unique_ptr<CanReader>> open_can_log(const std::string& path, std::int64_t offset_ns) {
  if (is_capture(path)) {
    auto capture = CanCaptureReader::open(path, offset_ns);
    if (!capture) return tl::unexpected(capture.error());
    return std::unique_ptr<CanReader>(*std::move(capture));
  }
  auto log = CanLogReader::open(path, "", offset_ns);
  if (!log) return tl::unexpected(log.error());
  return std::unique_ptr<CanReader>(*std::move(log));
}

}  // namespace roadvec
