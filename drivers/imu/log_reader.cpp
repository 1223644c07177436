#include "drivers/imu/log_reader.h"

#include "drivers/recording/log_stamp.h"

namespace roadvec {
namespace {

int nibble(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return -1;
}

std::string_view without_blanks_behind(std::string_view text) {
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r')) text.remove_suffix(1);
  return text;
}

}  // namespace

std::optional<ImuLogLine> parse_imu_log_line(std::string_view line, std::span<std::uint8_t> bytes) noexcept {
  ImuLogLine result;
  std::string_view digits = without_blanks_behind(line);
  const std::optional<SensorTime> time = take_log_stamp(digits);
  if (!time || digits.empty() || digits.size() % 2 != 0 || digits.size() / 2 > bytes.size()) return std::nullopt;
  for (std::size_t i = 0; i < digits.size(); i += 2) {
    const int high = nibble(digits[i]);
    const int low = nibble(digits[i + 1]);
    if (high < 0 || low < 0) return std::nullopt;
    bytes[i / 2] = static_cast<std::uint8_t>(high << 4 | low);
  }
  result.time = *time;
  result.byte_count = digits.size() / 2;
  return result;
}

Expected<std::unique_ptr<ImuLogReader>> ImuLogReader::open(const std::string& path) {
  Expected<RecordingFile> file = RecordingFile::open(path);
  if (!file) return fail(file.error().message);
  return std::unique_ptr<ImuLogReader>(new ImuLogReader(*std::move(file)));
}

ImuReadResult ImuLogReader::read(ImuBytes& bytes, std::chrono::milliseconds /*timeout*/) noexcept {
  while (const std::optional<std::string_view> text = file_.next_line()) {
    if (without_blanks_behind(*text).empty()) continue;
    const std::optional<ImuLogLine> line = parse_imu_log_line(*text, bytes_);
    if (!line) {
      if (counters_.bad_line_count++ == 0) counters_.first_bad_line = file_.line_number();
      continue;
    }
    counters_.byte_count += line->byte_count;
    bytes = {line->time, true, std::span<const std::uint8_t>(bytes_).first(line->byte_count)};
    return ImuReadResult::bytes;
  }
  return file_.failed() ? ImuReadResult::failed : ImuReadResult::end;
}

Expected<std::unique_ptr<ImuRawReader>> ImuRawReader::open(const std::string& path) {
  Expected<RecordingFile> file = RecordingFile::open(path);
  if (!file) return fail(file.error().message);
  return std::unique_ptr<ImuRawReader>(new ImuRawReader(*std::move(file)));
}

ImuReadResult ImuRawReader::read(ImuBytes& bytes, std::chrono::milliseconds /*timeout*/) noexcept {
  bytes = {{}, false, file_.next_bytes()};
  if (bytes.bytes.empty()) return file_.failed() ? ImuReadResult::failed : ImuReadResult::end;
  counters_.byte_count += bytes.bytes.size();
  return ImuReadResult::bytes;
}

Expected<std::unique_ptr<ImuReader>> open_imu_recording(const std::string& path) {
  if (path.ends_with(".bin")) return ImuRawReader::open(path);
  return ImuLogReader::open(path);
}

}  // namespace roadvec
