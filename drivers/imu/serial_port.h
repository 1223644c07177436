#pragma once

#include <string>

#include "core/base/error.h"

namespace roadvec {

enum class SerialUse : bool { read, read_and_write };

/// Opens a serial line or USB device without waiting for a carrier: raw bytes, eight data bits, no parity, no flow
/// control. The error names the path and what to do about it. The descriptor belongs to the caller.
[[nodiscard]] Expected<int> open_serial(const std::string& path, unsigned baud, SerialUse use);

}  // namespace roadvec
