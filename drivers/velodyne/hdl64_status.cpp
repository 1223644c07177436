#include "drivers/velodyne/hdl64_status.h"

namespace roadvec {

void Hdl64Status::add(std::uint8_t type, std::uint8_t value, std::uint32_t missing_before) noexcept {
  table_.add(type, value, missing_before);
  switch (type) {
    case 'H':
      hour = value;
      break;
    case 'M':
      minute = value;
      break;
    case 'S':
      second = value;
      break;
    case 'D':
      day = value;
      break;
    case 'N':
      month = value;
      break;
    case 'Y':
      year = value;
      break;
    case 'G':
      gps = value;
      break;
    case 'T':
      temperature_degc = value;
      break;
    case 'V':
      firmware = value;
      break;
    case 'W':
      warnings = value;
      break;
    default:
      break;
  }
}

}  // namespace roadvec
