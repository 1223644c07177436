#include "drivers/can/candump_reader.h"

#include <algorithm>
#include <filesystem>
#include <system_error>
#include <utility>

#include "drivers/can/candump_line.h"

namespace roadvec {

Expected<std::unique_ptr<CandumpReader>> CandumpReader::open(const std::string& path, const std::string& interface) {
  std::error_code ignored;
  Expected<RecordingFile> file =
      std::filesystem::is_fifo(path, ignored) ? RecordingFile::open_fifo(path) : RecordingFile::open(path);
  if (!file) return fail(file.error().message);
  return std::unique_ptr<CandumpReader>(new CandumpReader(*std::move(file), interface));
}

CanReadResult CandumpReader::read(CanFrame& frame, std::chrono::milliseconds timeout) noexcept {
  if (next_frame(frame)) return CanReadResult::frame;
  if (file_.endless() && !file_.failed()) {
    return file_.wait(timeout) && next_frame(frame) ? CanReadResult::frame : CanReadResult::quiet;
  }
  return file_.failed() ? CanReadResult::failed : CanReadResult::end;
}

/// The next frame there is to read, whatever lines come before it.
bool CandumpReader::next_frame(CanFrame& frame) noexcept {
  while (const std::optional<std::string_view> text = file_.next_line()) {
    CandumpLine line = parse_candump_line(*text);
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
    ++counters_.frame_count;
    if (frame.error) count_error_frame(frame, counters_);
    return true;
  }
  return false;
}

std::string_view CandumpReader::interface_name(std::uint8_t interface) const noexcept {
  return interface < name_count_ ? names_[interface].view() : std::string_view();
}

bool CandumpReader::number_of(std::string_view name, std::uint8_t& number) noexcept {
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

void CandumpReader::count_bad_line(std::string_view reason) noexcept {
  if (counters_.bad_line_count++ > 0) return;
  counters_.first_bad_line = file_.line_number();
  first_bad_line_reason_ = reason;
}

}  // namespace roadvec
