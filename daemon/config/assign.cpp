#include "daemon/config/assign.h"

#include <unistd.h>
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <span>
#include <sstream>

#include "drivers/velodyne/calibration.h"

namespace roadvec {
namespace {

constexpr std::size_t kInterfaceNameLength = 15;  // IFNAMSIZ less the terminating zero

const char* type_name(const toml::node& value) {
  if (value.is_table()) return "a table";
  if (value.is_array()) return "a list";
  if (value.is_string()) return "a text";
  if (value.is_integer()) return "a whole number";
  if (value.is_floating_point()) return "a number";
  if (value.is_boolean()) return "true or false";
  return "a date or time";
}

template <class Texts>
std::string listed(const Texts& texts) {
  std::string list;
  for (const auto& text : texts) list += (list.empty() ? "\"" : ", \"") + std::string(text) + "\"";
  return list;
}

bool is_signal_name(const std::string& name) {
  const std::size_t dot = name.find('.');
  return dot != std::string::npos && dot > 0 && dot + 1 < name.size() && name.find('.', dot + 1) == std::string::npos;
}

/// One value for one field; every path out either sets the target or objects.
class Assignment {
 public:
  Assignment(const Field& field, const toml::node& value, const std::filesystem::path& folder, ConfigContext context,
             ConfigDocument& document)
      : field_(field), value_(value), folder_(folder), context_(context), document_(document) {}

  void operator()(double* target) const {
    if (!value_.is_number()) return wrong_type("a number");
    const double number = value_.value<double>().value_or(0.0);
    if (in_range(number)) *target = number;
  }

  void operator()(int* target) const {
    if (!value_.is_integer()) return wrong_type("a whole number");
    const std::int64_t number = value_.value<std::int64_t>().value_or(0);
    if (in_range(static_cast<double>(number))) *target = static_cast<int>(number);
  }

  void operator()(bool* target) const {
    if (!value_.is_boolean()) return wrong_type("true or false");
    *target = value_.value<bool>().value_or(false);
  }

  void operator()(const Choice& choice) const {
    std::string name;
    if (!text(value_, name)) return;
    const auto found = std::find(choice.names.begin(), choice.names.end(), name);
    if (found == choice.names.end()) return object("\"" + name + "\" is not known; one of " + listed(choice.names));
    *choice.value = static_cast<std::uint8_t>(found - choice.names.begin());
  }

  void operator()(std::string* target) const {
    std::string given;
    if (!text(value_, given)) return;
    const auto& choices = field_.choices;
    if (!choices.empty() && std::find(choices.begin(), choices.end(), given) == choices.end()) {
      return object("\"" + given + "\" is not known; one of " + listed(choices));
    }
    if (field_.names != Names::can_source || given.empty()) {
      *target = given;
    } else if (context_ == ConfigContext::drive) {
      if (const auto path = resolved(given); readable(path)) *target = path.native();
    } else if (given.find('/') != std::string::npos) {
      *target = resolved(given).native();
    } else if (given.size() > kInterfaceNameLength) {
      object("\"" + given + "\" is too long for an interface; name one of `ip link`, or a path with a '/'");
    } else {
      *target = given;
    }
  }

  void operator()(std::filesystem::path* target) const {
    std::string given;
    if (!text(value_, given)) return;
    const bool streamed = field_.names == Names::calibration && given == kStreamedCalibration;
    const auto path = given.empty() || streamed ? std::filesystem::path(given) : resolved(given);
    const bool read = field_.names == Names::input_file || (field_.names == Names::calibration && !streamed);
    if (read && !given.empty() && !readable(path)) return;
    *target = path;
  }

  void operator()(SignalSettings* target) const {
    SignalSettings given;
    if (signal(value_, given)) *target = given;
  }

  void operator()(std::vector<SignalSettings>* target) const {
    const toml::array* list = value_.as_array();
    if (!list) return wrong_type("a list of signals");
    if (list->size() > 4) {
      return object("has " + std::to_string(list->size()) + " signals; " + field_.meaning);
    }
    std::vector<SignalSettings> given(list->size());
    for (std::size_t i = 0; i < given.size(); ++i) {
      if (!signal(*list->get(i), given[i])) return;
      if (given[i].sum.empty()) return object("holds an empty name; write \"Message.Signal\", as in the DBC");
    }
    *target = given;
  }

  void operator()(std::vector<MessageSettings>* target) const {
    const toml::array* list = value_.as_array();
    if (!list) return wrong_type("a list of tables");
    std::vector<MessageSettings> given(list->size());
    for (std::size_t i = 0; i < given.size(); ++i) {
      const toml::table* table = list->get(i)->as_table();
      if (!table) return object("holds " + std::string(type_name(*list->get(i))) + "; must hold tables in { }");
      if (!message_table(*table, given[i])) return;
    }
    *target = given;
  }

 private:
  void object(const std::string& what) const { document_.object(field_.key, what); }
  void wrong_type(const std::string& wanted) const {
    object("is " + std::string(type_name(value_)) + "; must be " + wanted + ": " + field_.meaning);
  }

  bool in_range(double number) const {
    if (number >= field_.min && number <= field_.max) return true;  // false for NaN too
    std::ostringstream what;
    what.precision(12);
    what << number << " is out of range; " << field_.min << " to " << field_.max << ": " << field_.meaning;
    object(what.str());
    return false;
  }

  bool text(const toml::node& value, std::string& given) const {
    const auto maybe_text = value.value<std::string>();
    if (!value.is_string() || !maybe_text) {
      object("is " + std::string(type_name(value)) + "; must be a text in quotes: " + field_.meaning);
      return false;
    }
    const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; };
    if (std::any_of(maybe_text->begin(), maybe_text->end(), is_control)) {
      object("holds a control character; remove it");
      return false;
    }
    given = *maybe_text;
    return true;
  }

  /// A signal name: empty where nothing is sent.
  bool signal_name(const toml::node& value, std::string& given) const {
    if (!text(value, given)) return false;
    if (given.empty() || is_signal_name(given)) return true;
    object("\"" + given + "\" does not name a signal; write \"Message.Signal\", as in the DBC");
    return false;
  }

  bool signal(const toml::node& value, SignalSettings& given) const {
    if (const toml::table* table = value.as_table()) return signal_table(*table, given);
    std::string name;
    if (!signal_name(value, name)) return false;
    if (!name.empty()) given.sum = {name};
    return true;
  }

  bool signal_table(const toml::table& table, SignalSettings& given) const {
    for (const auto& [key, value] : table) {
      if (key == "sum") {
        if (!signal_sum(value, given)) return false;
      } else if (key == "sign" || key == "valid") {
        if (!signal_name(value, key == "sign" ? given.sign : given.valid)) return false;
      } else if (key == "valid_raw" || key == "invalid_raw") {
        if (!raw_value(key.str(), value, key == "valid_raw" ? given.valid_raw : given.invalid_raw)) return false;
      } else if (key == "unit") {
        if (!text(value, given.unit)) return false;
      } else if (key == "scale") {
        given.scale = value.value<double>().value_or(0.0);
        if (!value.is_number() || !(std::abs(given.scale) >= 1e-9 && std::abs(given.scale) <= 1e9)) {
          object("'scale' must be a number between 1e-9 and 1e9, or its negative");
          return false;
        }
      } else {
        object("'" + std::string(key.str()) +
               "' is not part of a signal; one of \"sum\", \"sign\", \"valid\", \"valid_raw\", \"invalid_raw\", "
               "\"unit\", \"scale\"");
        return false;
      }
    }
    if (given.valid_raw && given.valid.empty()) {
      object("has 'valid_raw' without 'valid'; name the signal that it is a value of");
      return false;
    }
    if (given.sum.empty()) object("lacks 'sum'; name the signals to add up: sum = [\"Message.Signal\"]");
    return !given.sum.empty();
  }

  bool raw_value(std::string_view key, const toml::node& value, std::optional<std::int64_t>& given) const {
    given = value.value<std::int64_t>();
    if (value.is_integer() && given && *given >= 0) return true;
    object("'" + std::string(key) + "' must be a whole number from 0, the bits as they are on the bus");
    return false;
  }

  bool message_table(const toml::table& table, MessageSettings& given) const {
    for (const auto& [key, value] : table) {
      std::string kind;
      if (key == "message" || key == "counter" || key == "checksum") {
        std::string& name = key == "message" ? given.message : key == "counter" ? given.counter : given.checksum;
        if (!text(value, name)) return false;
      } else if (key == "kind") {
        if (!text(value, kind)) return false;
        const auto found = std::find(std::begin(kChecksumNames) + 1, std::end(kChecksumNames), kind);
        if (found == std::end(kChecksumNames)) {
          object("kind \"" + kind + "\" is not known; one of " + listed(std::span(kChecksumNames).subspan(1)));
          return false;
        }
        given.kind = static_cast<ChecksumKind>(found - std::begin(kChecksumNames));
      } else if (key == "timeout_ms") {
        given.timeout_ms = value.value<double>().value_or(0.0);
        if (!value.is_number() || !(given.timeout_ms >= 1 && given.timeout_ms <= 60000)) {
          object("'timeout_ms' must be a number, 1 to 60000");
          return false;
        }
      } else {
        object("'" + std::string(key.str()) +
               "' is not part of a message; one of \"message\", \"counter\", \"checksum\", \"kind\", \"timeout_ms\"");
        return false;
      }
    }
    if (given.message.empty()) object("lacks 'message'; name it as in the DBC");
    return !given.message.empty();
  }

  bool signal_sum(const toml::node& value, SignalSettings& given) const {
    const toml::array* list = value.as_array();
    if (!list) {
      object("'sum' is " + std::string(type_name(value)) + "; must be a list of signals");
      return false;
    }
    for (const toml::node& entry : *list) {
      std::string name;
      if (!signal_name(entry, name)) return false;
      if (!name.empty()) given.sum.push_back(name);
    }
    return true;
  }

  std::filesystem::path resolved(const std::string& given) const { return (folder_ / given).lexically_normal(); }

  bool readable(const std::filesystem::path& path) const {
    if (context_ == ConfigContext::overrides || ::access(path.c_str(), R_OK) == 0) return true;
    object("cannot read '" + path.native() + "': " + std::strerror(errno) +
           "; paths are relative to the folder of this file");
    return false;
  }

  const Field& field_;
  const toml::node& value_;
  const std::filesystem::path& folder_;
  ConfigContext context_;
  ConfigDocument& document_;
};

}  // namespace

void assign(const Field& field, const toml::node& value, const std::filesystem::path& folder, ConfigContext context,
            ConfigDocument& document) {
  std::visit(Assignment(field, value, folder, context, document), field.target);
}

}  // namespace roadvec
