#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "drivers/can/frame.h"

namespace roadvec {

enum class ByteOrder : std::uint8_t {
  motorola,  ///< "@0", big endian: start_bit is the most significant bit, the signal grows towards higher bytes
  intel,     ///< "@1", little endian: start_bit is the least significant bit
};

enum class SignalCoding : std::uint8_t { unsigned_integer, signed_integer, float32, float64 };

/// Both ends belong to it.
struct DbcRange {
  std::uint64_t first = 0, last = 0;
};

struct DbcSignal {
  std::string name;
  std::uint16_t start_bit = 0;   ///< byte * 8 + bit, bit 0 = least significant of its byte; as written in the file
  std::uint8_t length_bits = 0;  ///< 1..64; the signal lies within its message
  ByteOrder order = ByteOrder::intel;
  SignalCoding coding = SignalCoding::unsigned_integer;
  double factor = 1.0;  ///< physical = raw * factor + offset
  double offset = 0.0;
  std::string unit;
  bool is_selector = false;                ///< "M" or "m3M": says which multiplexed signals a frame carries
  std::vector<DbcRange> multiplex_values;  ///< "m3", SG_MUL_VAL_: present only while the selector's raw value is in one
  std::string selector;                    ///< SG_MUL_VAL_: its name; "": the message's only plain selector, "M"
};

struct DbcMessage {
  CanId id;
  std::string name;
  std::uint8_t length_bytes = 0;
  std::uint32_t cycle_time_ms = 0;  ///< attribute GenMsgCycleTime; 0: not told
  std::vector<DbcSignal> signals;
};

/// A line that is not as the format asks. Either it was left out, or read in the way `text` says.
struct DbcDiagnostic {
  std::size_t line = 0;
  std::string text;  ///< "file:line: reason"
};

struct DbcFile {
  std::string name;
  std::vector<DbcMessage> messages;
  std::vector<DbcDiagnostic> diagnostics;
};

/// Messages and signals of a DBC text: a bad line costs itself and one diagnostic, never the file. Read without a word:
/// names with a leading digit, missing zeros, colons and semicolons that nothing depends on. Value tables, comments and
/// attributes but the cycle time are passed over. `name` is what diagnostics call the text. Pure.
[[nodiscard]] DbcFile parse_dbc(std::string_view text, std::string_view name);

[[nodiscard]] Expected<DbcFile> load_dbc(const std::string& path);

/// A signal with the message that carries it; both belong to the DbcFile.
struct DbcSignalRef {
  const DbcMessage* message = nullptr;
  const DbcSignal* signal = nullptr;
};

/// Finds "Message.Signal"; the error names what is nearest to it in the file.
[[nodiscard]] Expected<DbcSignalRef> find_signal(const DbcFile& file, std::string_view message_dot_signal);

}  // namespace roadvec
