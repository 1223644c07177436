#include "drivers/recording/recording_file.h"

#include <fcntl.h>
#include <poll.h>
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
  return RecordingFile(fd, false);
}

Expected<RecordingFile> RecordingFile::open_fifo(const std::string& path) {
  // O_RDWR: being its own writer, the FIFO neither waits for one nor ends when one leaves [fifo(7)].
  const int fd = ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) {
    return fail("cannot open the FIFO " + path + ": " + std::strerror(errno) +
                "; it must be there, and readable and writable");
  }
  struct stat status {};
  if (::fstat(fd, &status) != 0 || !S_ISFIFO(status.st_mode)) {
    ::close(fd);
    return fail("cannot open the FIFO " + path + ": it is none; make it with mkfifo");
  }
  return RecordingFile(fd, true);
}

RecordingFile::RecordingFile(RecordingFile&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)),
      endless_(other.endless_),
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
  if (count < 0 && errno != EAGAIN) failed_ = true;
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
    // The rest of a FIFO's line may still come; of one longer than the buffer it cannot.
    if (end_ == 0 || (endless_ && end_ < buffer_.size())) return std::nullopt;
    begin_ = end_;
    ++line_number_;
    return std::string_view(buffer_.data(), end_);  // fill() has moved it to the front
  }
}

bool RecordingFile::wait(std::chrono::milliseconds timeout) const noexcept {
  pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
  return ::poll(&waiting, 1, static_cast<int>(timeout.count())) > 0;
}

std::span<const std::uint8_t> RecordingFile::next_bytes() noexcept {
  if (begin_ == end_) fill();
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(buffer_.data()) + begin_, end_ - begin_);
  begin_ = end_;
  return bytes;
}

}  // namespace roadvec
