#include "tools/recording/output_file.h"

#include <cerrno>
#include <cstdarg>
#include <cstring>

namespace roadvec {

Expected<OutputFile> OutputFile::create(const std::filesystem::path& path) {
  std::FILE* file = std::fopen(path.c_str(), "wbx");
  if (file == nullptr) return fail("cannot create " + path.string() + ": " + std::strerror(errno));
  return OutputFile(file, path);
}

void OutputFile::write(std::string_view text) {
  write({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

void OutputFile::write(std::span<const std::uint8_t> bytes) {
  if (first_errno_ == 0 && std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size())
    first_errno_ = errno;
  size_bytes_ += bytes.size();
}

Expected<void> OutputFile::close() {
  const int result = std::fclose(file_.release());
  if (first_errno_ == 0 && result != 0) first_errno_ = errno;
  if (first_errno_ == 0) return {};
  return fail("cannot write " + path_.string() + ": " + std::strerror(first_errno_) + "; make room and run again");
}

std::string print(const char* format, ...) {
  va_list arguments, again;
  va_start(arguments, format);
  va_copy(again, arguments);
  const int length = std::vsnprintf(nullptr, 0, format, arguments);
  va_end(arguments);
  std::string text(static_cast<std::size_t>(length > 0 ? length : 0), '\0');
  std::vsnprintf(text.data(), text.size() + 1, format, again);
  va_end(again);
  return text;
}

}  // namespace roadvec
