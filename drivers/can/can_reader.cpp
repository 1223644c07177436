#include "drivers/can/can_reader.h"

#include <linux/can/error.h>

namespace roadvec {

void count_error_frame(const CanFrame& frame, CanCounters& counters) noexcept {
  constexpr std::uint32_t kBusErrors = CAN_ERR_LOSTARB | CAN_ERR_PROT | CAN_ERR_ACK | CAN_ERR_BUSERROR;
  constexpr std::uint32_t kOthers = CAN_ERR_TX_TIMEOUT | CAN_ERR_TRX | CAN_ERR_CNT;
  constexpr std::uint8_t kOverflow = CAN_ERR_CRTL_RX_OVERFLOW;
  constexpr std::uint8_t kManyErrors =
      CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING | CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE;
  ++counters.error_frame_count;
  if ((frame.id & CAN_ERR_BUSOFF) != 0) {
    ++counters.bus_off_count;
    counters.state = CanState::bus_off;
  }
  if ((frame.id & CAN_ERR_RESTARTED) != 0) {
    ++counters.restarted_count;
    counters.state = CanState::working;
  }
  if ((frame.id & CAN_ERR_CRTL) != 0) {
    ++counters.controller_problem_count;
    if ((frame.data[1] & kOverflow) != 0) ++counters.controller_overflow_count;
    if ((frame.data[1] & kManyErrors) != 0) ++counters.passive_count;
  }
  if ((frame.id & kBusErrors) != 0) ++counters.bus_error_count;
  if ((frame.id & kOthers) != 0) ++counters.other_error_count;
}

}  // namespace roadvec
