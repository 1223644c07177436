#include "daemon/stages/motion_input.h"

namespace roadvec {

template <class Decoder>
const MotionSample* CanInput<Decoder>::front(std::chrono::milliseconds timeout) noexcept {
  while (samples_.empty() && !over_) {
    const CanReadResult result = reader_->read(frame_, timeout);
    if (result == CanReadResult::quiet) return nullptr;
    over_ = result != CanReadResult::frame;
    if (!over_) samples_ = decoder_.decode(frame_);
  }
  return samples_.empty() ? nullptr : &samples_.front();
}

template <class Decoder>
const MotionSample* ImuInput<Decoder>::front(std::chrono::milliseconds timeout) noexcept {
  while (!has_sample_ && !over_) {
    has_sample_ = decoder_.next(bytes_, sample_);
    if (has_sample_) break;
    const ImuReadResult result = reader_->read(bytes_, timeout);
    if (result == ImuReadResult::quiet) return nullptr;
    over_ = result != ImuReadResult::bytes;
  }
  return has_sample_ ? &sample_ : nullptr;
}

template class CanInput<MotionDecoder>;
template class CanInput<ImuCanDecoder>;
template class ImuInput<XsensDecoder>;
template class ImuInput<NcomDecoder>;

}  // namespace roadvec
