#include "drivers/imu/serial_reader.h"

#include <poll.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "drivers/imu/serial_port.h"

namespace roadvec {

Expected<std::unique_ptr<SerialReader>> SerialReader::open(const std::string& path, unsigned baud) {
  const Expected<int> fd = open_serial(path, baud, SerialUse::read);
  if (!fd) return fail(fd.error().message);
  return std::unique_ptr<SerialReader>(new SerialReader(path, baud, *fd));
}

SerialReader::~SerialReader() {
  if (fd_ >= 0) ::close(fd_);
}

ImuReadResult SerialReader::read(ImuBytes& bytes, std::chrono::milliseconds timeout) noexcept {
  if (fd_ < 0) {
    wait_and_reopen(timeout);
    return ImuReadResult::quiet;
  }
  pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
  const int ready = ::poll(&waiting, 1, static_cast<int>(timeout.count()));
  if (ready < 0) return errno == EINTR ? ImuReadResult::quiet : ImuReadResult::failed;
  if (ready == 0) return ImuReadResult::quiet;
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  const ssize_t count = ::read(fd_, buffer_.data(), buffer_.size());
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return ImuReadResult::quiet;
  // A line that is hung up reads as an end of file; one whose adapter was pulled fails (EIO, ENXIO, ENODEV).
  if (count <= 0) {
    lose_device();
    return ImuReadResult::quiet;
  }
  counters_.byte_count += static_cast<std::uint64_t>(count);
  bytes.time = {static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec};
  bytes.has_time = true;
  bytes.bytes = std::span<const std::uint8_t>(buffer_).first(static_cast<std::size_t>(count));
  return ImuReadResult::bytes;
}

void SerialReader::wait_and_reopen(std::chrono::milliseconds timeout) noexcept {
  // At least 1 ms, so that a caller who never waits does not spin and gets its device back too.
  const std::chrono::milliseconds pause = std::max(timeout, std::chrono::milliseconds{1});
  ::poll(nullptr, 0, static_cast<int>(pause.count()));
  if (!backoff_.due_after(pause)) return;
  const Expected<int> fd = open_serial(path_, baud_, SerialUse::read);
  if (!fd) return;
  fd_ = *fd;
  backoff_.reset();
  ++counters_.reopened_count;
}

void SerialReader::lose_device() noexcept {
  ++counters_.device_lost_count;
  ::close(fd_);
  fd_ = -1;
}

}  // namespace roadvec
