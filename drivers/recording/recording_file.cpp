#include "drivers/recording/recording_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace roadvec {

Expected<RecordingFile> RecordingFile::open(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return fail("cannot read the recording " + path + ": " + std::strerror(errno));
  struct stat status {};
  if (::fstat(fd, &status) != 0 || S_ISDIR(status.st_mode)) {
    ::close(fd);
    return fail("cannot read the recording " + path + ": it is a folder");
  }
  return RecordingFile(fd);
}

RecordingFile::RecordingFile(RecordingFile&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)),
      buffer_(std::move(other.buffer_)),
      begin_(other.begin_),
      end_(other.end_),
      line_number_(other.line_number_),
      failed_(other.failed_) {}

RecordingFile::~RecordingFile() {
  if (fd_ >= 0) ::close(fd_);
}

/// Moves what is left to the front and reads behind it; false: nothing more came, or there is no room.
bool RecordingFile::fill() noexcept {
  std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
  end_ -= begin_;
  begin_ = 0;
  if (end_ == buffer_.size()) return false;
  ssize_t count = 0;
  do {
    count = ::read(fd_, buffer_.data() + end_, buffer_.size() - end_);
  } while (count < 0 && errno == EINTR);
  if (count < 0) failed_ = true;
  if (count <= 0) return false;
  end_ += static_cast<std::size_t>(count);
  return true;
}

std::optional<std::string_view> RecordingFile::next_line() noexcept {
  std::size_t searched = 0;
  for (;;) {
    const std::string_view unread(buffer_.data() + begin_, end_ - begin_);
    const std::size_t newline = unread.find('\n', searched);
    if (newline != std::string_view::npos) {
      begin_ += newline + 1;
      ++line_number_;
      return unread.substr(0, newline);
    }
    searched = unread.size();
    if (fill()) continue;
    if (end_ == 0) return std::nullopt;
    begin_ = end_;
    ++line_number_;
    return std::string_view(buffer_.data(), end_);  // fill() has moved it to the front
  }
}

std::span<const std::uint8_t> RecordingFile::next_bytes() noexcept {
  if (begin_ == end_) fill();
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(buffer_.data()) + begin_, end_ - begin_);
  begin_ = end_;
  return bytes;
}

}  // namespace roadvec
