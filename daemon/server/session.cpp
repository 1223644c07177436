#include "daemon/server/session.h"

#include <sys/socket.h>

#include <cerrno>
#include <utility>

namespace roadvec {
namespace {

bool only_later(ssize_t result) { return result < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR); }

}  // namespace

bool Session::receive(double now_s) {
  if (!input_.has_bytes()) input_progress_s_ = now_s;
  const std::span<char> space = input_.space();
  const ssize_t count = ::recv(socket_.get(), space.data(), space.size(), MSG_DONTWAIT);
  if (count > 0) input_.received(static_cast<std::size_t>(count));
  return count > 0 || only_later(count);
}

std::size_t Session::waiting_bytes() const {
  std::size_t bytes = 0;
  for (const SharedFrame& frame : output_) bytes += frame->size();
  return bytes - sent_of_front_;
}

void Session::queue(SharedFrame frame, double now_s) {
  if (output_.empty()) progress_s_ = now_s;
  output_.push_back(std::move(frame));
}

bool Session::send(double now_s) {
  while (!output_.empty()) {
    const std::string& frame = *output_.front();
    const ssize_t count = ::send(socket_.get(), frame.data() + sent_of_front_, frame.size() - sent_of_front_,
                                 MSG_DONTWAIT | MSG_NOSIGNAL);
    if (count < 0) {
      was_full_ = true;
      return only_later(count);
    }
    progress_s_ = now_s;
    sent_bytes += static_cast<std::size_t>(count);
    sent_of_front_ += static_cast<std::size_t>(count);
    if (sent_of_front_ < frame.size()) continue;
    ++sent_frames;
    sent_of_front_ = 0;
    output_.pop_front();
  }
  // While frames waited we did not read: the time of a half frame starts again. Not so when they went at once, or
  // heartbeats would put it off for ever.
  if (std::exchange(was_full_, false)) input_progress_s_ = now_s;
  return true;
}

void Session::leave(SharedFrame bye, double now_s) {
  while (output_.size() > (sent_of_front_ > 0 ? 1U : 0U)) output_.pop_back();
  queue(std::move(bye), now_s);
  following.reset();
  delivery.reset();
  enter(State::leaving, now_s);
}

}  // namespace roadvec
