#include "drivers/can/can_log_reader.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "drivers/can/candump_line.h"

namespace roadvec {

namespace {

constexpr std::size_t kQuotedBytes = 60;

/// Formats that begin with these bytes are known and not read.
struct Foreign {
  std::string_view begin, name, remedy;
};
constexpr Foreign kForeign[] = {
    {"LOGG", "Vector BLF", "convert it to ASC (CANalyzer, or can_logconvert of python-can)"},
};

std::string printable(std::string_view line) {
  std::string text(line.substr(0, kQuotedBytes));
  const auto is_printable = [](char c) { return c >= 0x20 && c < 0x7F; };
  std::replace_if(
      text.begin(), text.end(), [&](char c) { return !is_printable(c); }, '.');
  return text;
}

/// True for ASC, false for candump; the first lines tell. A file without any line is an empty candump log.
Expected<bool> is_asc(const std::string& path) {
  constexpr int kLooked = 20;  // a log may begin in the middle of a line, or with what a terminal said
  Expected<RecordingFile> file = RecordingFile::open(path);
  if (!file) return fail(file.error().message);
  std::string first;
  for (int i = 0; i < kLooked; ++i) {
    const std::optional<std::string_view> line = file->next_line();
    if (!line) break;
    for (const Foreign& foreign : kForeign) {
      if (i == 0 && line->starts_with(foreign.begin)) {
        return fail(path + " is " + std::string(foreign.name) + ", which is not read: " + std::string(foreign.remedy));
      }
    }
    if (AscLines::is_header(*line)) return true;
    const CandumpKind kind = parse_candump_line(*line).kind;
    if (kind == CandumpKind::frame || kind == CandumpKind::drops) return false;
    if (first.empty()) first = printable(*line);
  }
  if (first.empty()) return false;
  return fail(path + " is neither a candump log nor Vector ASC; it begins with '" + first + "'");
}

}  // namespace

Expected<std::unique_ptr<CanLogReader>> CanLogReader::open(const std::string& path, const std::string& interface,
                                                           std::int64_t offset_ns) {
  std::error_code ignored;
  const bool is_fifo = std::filesystem::is_fifo(path, ignored);
  const Expected<bool> asc = is_fifo ? Expected<bool>(false) : is_asc(path);
  if (!asc) return fail(asc.error().message);
  Expected<RecordingFile> file = is_fifo ? RecordingFile::open_fifo(path) : RecordingFile::open(path);
  if (!file) return fail(file.error().message);
  return std::unique_ptr<CanLogReader>(new CanLogReader(*std::move(file), interface, offset_ns, *asc));
}

CanReadResult CanLogReader::read(CanFrame& frame, std::chrono::milliseconds timeout) noexcept {
  if (next_frame(frame)) return CanReadResult::frame;
  if (file_.endless() && !file_.failed()) {
    return file_.wait(timeout) && next_frame(frame) ? CanReadResult::frame : CanReadResult::quiet;
  }
  return file_.failed() ? CanReadResult::failed : CanReadResult::end;
}

/// The next frame there is to read, whatever lines come before it.
bool CanLogReader::next_frame(CanFrame& frame) noexcept {
  while (const std::optional<std::string_view> text = file_.next_line()) {
    CandumpLine line = is_asc_ ? asc_.parse(*text) : parse_candump_line(*text);
    if (line.kind == CandumpKind::drops) counters_.kernel_drop_count += line.dropped_count;
    if (line.kind == CandumpKind::bad) count_bad_line(line.reason);
    if (line.kind != CandumpKind::frame) continue;
    if (!wanted_.empty() && line.interface != wanted_) {
      ++counters_.foreign_interface_count;
      continue;
    }
    if (!line.has_time) {
      count_bad_line("the frame has no time: record with candump -L");
      continue;
    }
    if (!number_of(line.interface, line.frame.interface)) {
      count_bad_line("more than 16 interfaces, or one with a name of more than 32 letters");
      continue;
    }
    frame = line.frame;
    // Unsigned: the sum of two absurd times wraps.
    frame.time.ns =
        static_cast<std::int64_t>(static_cast<std::uint64_t>(frame.time.ns) + static_cast<std::uint64_t>(offset_ns_));
    ++counters_.frame_count;
    if (frame.error) count_error_frame(frame, counters_);
    return true;
  }
  return false;
}

std::string_view CanLogReader::interface_name(std::uint8_t interface) const noexcept {
  return interface < name_count_ ? names_[interface].view() : std::string_view();
}

bool CanLogReader::number_of(std::string_view name, std::uint8_t& number) noexcept {
  std::size_t i = 0;
  while (i < name_count_ && names_[i].view() != name) ++i;
  if (i == kMaxInterfaces || name.size() > kMaxNameBytes) return false;
  if (i == name_count_) {
    std::copy(name.begin(), name.end(), names_[i].text.begin());
    names_[i].length = name.size();
    ++name_count_;
  }
  number = static_cast<std::uint8_t>(i);
  return true;
}

void CanLogReader::count_bad_line(std::string_view reason) noexcept {
  if (counters_.bad_line_count++ > 0) return;
  counters_.first_bad_line = file_.line_number();
  first_bad_line_reason_ = reason;
}

}  // namespace roadvec
