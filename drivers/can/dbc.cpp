#include "drivers/can/dbc.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>

#include "drivers/can/dbc_cursor.h"

namespace roadvec {
namespace {

constexpr std::uint32_t kExtendedFlag = 0x80000000;
constexpr std::uint32_t kUnassignedSignalsId = 0xC0000000;  // pseudo message VECTOR__INDEPENDENT_SIG_MSG

// A string that runs on for longer was not closed.
constexpr std::size_t kLongestStringBytes = 16384;

// Statements that say nothing of where signals lie, each between blanks.
constexpr std::string_view kPassedOver =
    " VERSION NS_ NS_DESC_ BS_ BU_ CM_ CAT_ CAT_DEF_ FILTER EV_ EV_DATA_ ENVVAR_DATA_ VAL_ VAL_TABLE_ "
    "BA_DEF_ BA_REL_ BA_DEF_REL_ BA_DEF_DEF_REL_ BA_SGTYPE_ BA_DEF_SGTYPE_ SGTYPE_ "
    "SGTYPE_VAL_ SIGTYPE_VALTYPE_ SIG_TYPE_REF_ SIG_GROUP_ BO_TX_BU_ BU_SG_REL_ BU_EV_REL_ "
    "BU_BO_REL_ ";

/// True when the line can only be the start of a statement. Ends a string that somebody forgot to close.
bool begins_statement(std::string_view line) {
  DbcCursor cursor(line);
  const std::string_view word = cursor.take_name();
  if (word == "BO_" || word == "VAL_" || word == "SIG_VALTYPE_") {
    std::uint32_t id = 0;
    return cursor.take_number(id);
  }
  if (word == "SG_") return line.find('|') != std::string_view::npos && line.find('@') != std::string_view::npos;
  if (word == "BA_" || word == "BA_DEF_") return cursor.next_is('"') || cursor.take_name().starts_with("B");
  if (word != "CM_") return false;
  const std::string_view object = cursor.take_name();
  return object == "SG_" || object == "BO_" || object == "BU_" || (object.empty() && cursor.next_is('"'));
}

struct Line {
  std::string_view text;
  bool closed = true;  ///< false: a string begins that does not end
};

/// The line at the front of `text`, with the lines its strings run on over.
Line first_line(std::string_view text) {
  bool in_string = false;
  std::size_t opened = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (in_string && i - opened > kLongestStringBytes) break;
    if (text[i] == '"' && (i == 0 || text[i - 1] != '\\')) {
      in_string = !in_string;
      opened = i;
    }
    if (text[i] != '\n') continue;
    if (!in_string) return {text.substr(0, i), true};
    const std::string_view next = text.substr(i + 1);
    if (begins_statement(next.substr(0, next.find('\n')))) break;
  }
  if (!in_string) return {text, true};
  return {text.substr(0, text.find('\n')), false};
}

/// One past the signal's last bit, counted in the order in which it runs through the frame: one bound for both orders.
unsigned end_bit(const DbcSignal& signal) {
  const unsigned start = signal.start_bit;
  const unsigned first = signal.order == ByteOrder::intel ? start : start / 8 * 8 + (7 - start % 8);
  return first + signal.length_bits;
}

/// "M", "m3" or "m3M" between name and colon.
bool read_multiplexing(std::string_view word, DbcSignal& signal) {
  if (word.ends_with('M')) {
    signal.is_selector = true;
    word.remove_suffix(1);
  }
  if (word.empty()) return true;
  if (!word.starts_with('m')) return false;
  std::uint32_t value = 0;
  const auto [end, failed] = std::from_chars(word.data() + 1, word.data() + word.size(), value);
  if (failed != std::errc{} || end != word.data() + word.size()) return false;
  signal.multiplex_values = {{value, value}};
  return true;
}

/// start|length@order sign
bool read_position(DbcCursor& cursor, DbcSignal& signal) {
  unsigned length = 0;
  unsigned order = 0;
  if (!cursor.take_number(signal.start_bit) || !cursor.take('|') || !cursor.take_number(length) || !cursor.take('@') ||
      !cursor.take_number(order) || order > 1 || length < 1 || length > 64) {
    return false;
  }
  signal.length_bits = static_cast<std::uint8_t>(length);
  signal.order = order == 1 ? ByteOrder::intel : ByteOrder::motorola;
  if (cursor.take('-')) {
    signal.coding = SignalCoding::signed_integer;
    return true;
  }
  return cursor.take('+');
}

bool read_scaling(DbcCursor& cursor, DbcSignal& signal) {
  return cursor.take('(') && cursor.take_number(signal.factor) && cursor.take(',') &&
         cursor.take_number(signal.offset) && cursor.take(')') && std::isfinite(signal.factor) &&
         std::isfinite(signal.offset);
}

Expected<DbcSignal> read_signal(DbcCursor cursor) {
  DbcSignal signal;
  signal.name = cursor.take_name();
  if (signal.name.empty()) return fail("a signal without a name; left out");
  if (!read_multiplexing(cursor.take_name(), signal)) return fail("multiplexing is none of M, m<n>, m<n>M; left out");
  if (!cursor.take(':')) return fail("no ':' after the signal's name; left out");
  if (!read_position(cursor, signal)) return fail("position is not start|length@order and sign; left out");
  if (!read_scaling(cursor, signal)) return fail("no (factor,offset); left out");
  std::string_view skipped;
  std::string_view unit;
  if (!cursor.take('[') || !cursor.take_until(']', skipped)) return fail("no [minimum|maximum]; left out");
  if (!cursor.take('"') || !cursor.take_until('"', unit)) return fail("no \"unit\"; left out");
  signal.unit = unit;
  return signal;
}

class Parser {
 public:
  explicit Parser(std::string_view name) { file_.name = name; }

  DbcFile run(std::string_view text) && {
    if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    while (!text.empty()) {
      const Line line = first_line(text);
      if (line.closed) {
        read(line.text);
      } else {
        report("a string is not closed; left out");
      }
      text.remove_prefix(std::min(line.text.size() + 1, text.size()));
      line_ += 1 + static_cast<std::size_t>(std::count(line.text.begin(), line.text.end(), '\n'));
    }
    for (DbcMessage& message : file_.messages) {
      if (message.cycle_time_ms == 0) message.cycle_time_ms = default_cycle_time_ms_;
    }
    return std::move(file_);
  }

 private:
  void read(std::string_view line) {
    DbcCursor cursor(line);
    if (cursor.at_end()) return;
    const std::string_view word = cursor.take_name();
    if (word == "BO_") {
      read_message(cursor);
    } else if (word == "SG_") {
      add_signal(cursor);
    } else if (word == "SIG_VALTYPE_") {
      read_value_type(cursor);
    } else if (word == "SG_MUL_VAL_") {
      read_multiplex_values(cursor);
    } else if (word == "BA_" || word == "BA_DEF_DEF_") {
      read_cycle_time(cursor, word == "BA_");
      statement_open_ = line.find(';') == std::string_view::npos;
    } else if (is_passed_over(word)) {
      if (word == "CM_" && line.find("\"IMPORT ") != std::string_view::npos) {
        report("a template: the file it imports is not read; generate the full file first");
      }
      statement_open_ = line.find(';') == std::string_view::npos;
    } else if (!statement_open_) {
      report("no DBC statement begins like this; left out");
    } else {
      statement_open_ = line.find(';') == std::string_view::npos;
    }
  }

  static bool is_passed_over(std::string_view word) {
    return !word.empty() && kPassedOver.find(" " + std::string(word) + " ") != std::string_view::npos;
  }

  void read_message(DbcCursor cursor) {
    statement_open_ = false;
    in_message_ = MessageState::left_out;
    std::uint32_t id = 0;
    unsigned length_bytes = 0;
    if (!cursor.take_number(id)) return report("a message without an id; left out with its signals");
    const std::string_view name = cursor.take_name();
    if (id == kUnassignedSignalsId) return;
    if (name.empty() || !cursor.take(':') || !cursor.take_number(length_bytes)) {
      return report("a message is 'BO_ id name: length sender'; left out with its signals");
    }
    if (length_bytes > kMaxCanBytes) return report("longer than the 64 bytes of a frame; left out with its signals");
    if ((id & ~(kExtendedFlag | kExtendedCanIdMask)) != 0)
      return report("id has more than 29 bits; left out with its signals");
    const bool extended = (id & kExtendedFlag) != 0 || id > kStandardCanIdMask;
    if (extended && (id & kExtendedFlag) == 0)
      report("id has more than 11 bits but no extended flag; read as extended");
    file_.messages.push_back({.id = {id & kExtendedCanIdMask, extended},
                              .name = std::string(name),
                              .length_bytes = static_cast<std::uint8_t>(length_bytes),
                              .signals = {}});
    in_message_ = MessageState::kept;
  }

  void add_signal(DbcCursor cursor) {
    if (in_message_ == MessageState::left_out) return;
    if (in_message_ == MessageState::none) return report("a signal before the first message; left out");
    Expected<DbcSignal> signal = read_signal(cursor);
    if (!signal) return report(signal.error().message);
    DbcMessage& message = file_.messages.back();
    if (end_bit(*signal) > message.length_bytes * 8U) return report("the signal ends beyond its message; left out");
    message.signals.push_back(*std::move(signal));
  }

  /// SIG_VALTYPE_ id signal : 1 (float32) or 2 (float64); the colon is sometimes missing.
  void read_value_type(DbcCursor cursor) {
    std::uint32_t id = 0;
    unsigned type = 0;
    if (cursor.at_end()) return;  // in the list of NS_
    if (!cursor.take_number(id)) return report("SIG_VALTYPE_ without a message id; left out");
    const std::string_view name = cursor.take_name();
    cursor.take(':');
    if (!cursor.take_number(type) || type > 2) return report("SIG_VALTYPE_ is none of 0, 1, 2; left out");
    DbcSignal* signal = find(id, name);
    if (signal == nullptr) return report("SIG_VALTYPE_ of a signal that the file does not have; left out");
    if (type == 0) return;
    if (signal->length_bits != (type == 1 ? 32 : 64)) return report("a float of the wrong length; left out");
    signal->coding = type == 1 ? SignalCoding::float32 : SignalCoding::float64;
  }

  /// SG_MUL_VAL_ id signal selector 1-3, 5-5;
  void read_multiplex_values(DbcCursor cursor) {
    std::uint32_t id = 0;
    if (cursor.at_end()) return;  // in the list of NS_
    if (!cursor.take_number(id)) return report("SG_MUL_VAL_ without a message id; left out");
    DbcSignal* signal = find(id, cursor.take_name());
    const std::string_view selector = cursor.take_name();
    if (signal == nullptr || find(id, selector) == nullptr) {
      return report("SG_MUL_VAL_ of signals that the file does not have; left out");
    }
    std::vector<DbcRange> values;
    do {
      DbcRange range;
      if (!cursor.take_number(range.first) || !cursor.take('-') || !cursor.take_number(range.last)) {
        return report("SG_MUL_VAL_ is no list of first-last; left out");
      }
      values.push_back(range);
    } while (cursor.take(','));
    signal->selector = selector;
    signal->multiplex_values = std::move(values);
  }

  /// BA_ "GenMsgCycleTime" BO_ id value; BA_DEF_DEF_ "GenMsgCycleTime" value; other attributes are passed over.
  void read_cycle_time(DbcCursor cursor, bool of_message) {
    std::string_view name;
    if (!cursor.take('"') || !cursor.take_until('"', name) || name != "GenMsgCycleTime") return;
    std::uint32_t id = 0;
    std::uint32_t cycle_time_ms = 0;
    if (of_message && (cursor.take_name() != "BO_" || !cursor.take_number(id))) {
      return report("GenMsgCycleTime without a message id; left out");
    }
    if (!cursor.take_number(cycle_time_ms)) return report("GenMsgCycleTime is no number; left out");
    if (!of_message) {
      default_cycle_time_ms_ = cycle_time_ms;
    } else if (DbcMessage* message = find(id)) {
      message->cycle_time_ms = cycle_time_ms;
    } else {
      report("GenMsgCycleTime of a message that the file does not have; left out");
    }
  }

  DbcMessage* find(std::uint32_t id) {
    const CanId wanted{id & kExtendedCanIdMask, (id & kExtendedFlag) != 0 || id > kStandardCanIdMask};
    const auto has_id = [&wanted](const DbcMessage& message) { return message.id == wanted; };
    const auto found = std::find_if(file_.messages.begin(), file_.messages.end(), has_id);
    return found == file_.messages.end() ? nullptr : &*found;
  }
  DbcSignal* find(std::uint32_t id, std::string_view name) {
    DbcMessage* message = find(id);
    if (message == nullptr) return nullptr;
    const auto has_name = [name](const DbcSignal& signal) { return signal.name == name; };
    const auto found = std::find_if(message->signals.begin(), message->signals.end(), has_name);
    return found == message->signals.end() ? nullptr : &*found;
  }

  void report(std::string_view reason) {
    std::string text = file_.name + ":" + std::to_string(line_) + ": ";
    text += reason;
    file_.diagnostics.push_back({line_, std::move(text)});
  }

  enum class MessageState { none, kept, left_out };

  DbcFile file_;
  std::size_t line_ = 1;
  MessageState in_message_ = MessageState::none;
  std::uint32_t default_cycle_time_ms_ = 0;
  bool statement_open_ = false;  ///< lists of nodes and value tables run on over lines until a semicolon
};

}  // namespace

DbcFile parse_dbc(std::string_view text, std::string_view name) { return Parser(name).run(text); }

Expected<DbcFile> load_dbc(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  if (!stream || !(text << stream.rdbuf())) {
    return fail("cannot read the DBC file " + path + ", or it is empty: check the path and its permissions");
  }
  return parse_dbc(text.view(), path);
}

}  // namespace roadvec
