#include "daemon/config/config_text.h"

#include <algorithm>
#include <charconv>
#include <cstdio>

namespace roadvec {
namespace {

/// Shortest text that reads back as the same value, and as a floating-point number.
std::string toml_number(double value) {
  char buffer[40];
  const auto end = std::to_chars(std::begin(buffer), std::end(buffer), value).ptr;
  std::string text(buffer, end);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

std::string toml_string(std::string_view value) {
  std::string text = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') {
      text += '\\';
      text += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      char escape[8];
      std::snprintf(escape, sizeof escape, "\\u%04X", static_cast<unsigned>(c));
      text += escape;
    } else {
      text += c;
    }
  }
  return text + '"';
}

std::string toml_list(const std::vector<std::string>& values) {
  std::string text;
  for (const std::string& value : values) text += (text.empty() ? "" : ", ") + toml_string(value);
  return "[" + text + "]";
}

std::string toml_signal(const SignalSettings& signal) {
  if (signal == SignalSettings{}) return "\"\"";
  SignalSettings plain;
  plain.sum = signal.sum;
  if (signal == plain && plain.sum.size() == 1) return toml_string(plain.sum.front());
  std::string text = "{ sum = " + toml_list(signal.sum);
  if (!signal.sign.empty()) text += ", sign = " + toml_string(signal.sign);
  if (!signal.valid.empty()) text += ", valid = " + toml_string(signal.valid);
  if (signal.valid_raw) text += ", valid_raw = " + std::to_string(*signal.valid_raw);
  if (signal.invalid_raw) text += ", invalid_raw = " + std::to_string(*signal.invalid_raw);
  if (!signal.unit.empty()) text += ", unit = " + toml_string(signal.unit);
  return text + ", scale = " + toml_number(signal.scale) + " }";
}

std::string toml_message(const MessageSettings& message) {
  std::string text = "{ message = " + toml_string(message.message);
  if (!message.counter.empty()) text += ", counter = " + toml_string(message.counter);
  if (!message.checksum.empty()) text += ", checksum = " + toml_string(message.checksum);
  if (message.kind != ChecksumKind::none)
    text += ", kind = " + toml_string(kChecksumNames[static_cast<std::size_t>(message.kind)]);
  if (message.timeout_ms > 0) text += ", timeout_ms = " + toml_number(message.timeout_ms);
  return text + " }";
}

std::string toml_value(const FieldTarget& target) {
  struct {
    std::string operator()(const double* v) const { return toml_number(*v); }
    std::string operator()(const int* v) const { return std::to_string(*v); }
    std::string operator()(const bool* v) const { return *v ? "true" : "false"; }
    std::string operator()(const std::string* v) const { return toml_string(*v); }
    std::string operator()(const std::filesystem::path* v) const { return toml_string(v->native()); }
    std::string operator()(const Choice& v) const { return toml_string(v.names[*v.value]); }
    std::string operator()(const SignalSettings* v) const { return toml_signal(*v); }
    std::string operator()(const std::vector<SignalSettings>* v) const {
      std::string text;
      for (const SignalSettings& signal : *v) text += (text.empty() ? "" : ", ") + toml_signal(signal);
      return "[" + text + "]";
    }
    std::string operator()(const std::vector<MessageSettings>* v) const {
      std::string text;
      for (const MessageSettings& message : *v) text += (text.empty() ? "" : ", ") + toml_message(message);
      return "[" + text + "]";
    }
  } text_of;
  return std::visit(text_of, target);
}

std::string range_text(const Field& field) {
  if (std::holds_alternative<double*>(field.target))
    return "; " + toml_number(field.min) + " to " + toml_number(field.max);
  if (std::holds_alternative<int*>(field.target)) {
    return "; " + std::to_string(std::int64_t(field.min)) + " to " + std::to_string(std::int64_t(field.max));
  }
  const Choice* choice = std::get_if<Choice>(&field.target);
  std::string text;
  for (const char* name : choice ? choice->names : field.choices)
    text += (text.empty() ? "; " : " | ") + toml_string(name);
  return text;
}

std::string table_of(const Field& field) {
  const std::size_t dot = field.key.rfind('.');
  return dot == std::string::npos ? "" : field.key.substr(0, dot);
}

/// `shown` and `defaults` are the same list, bound to two settings.
std::string tables_text(const std::vector<Field>& shown, const std::vector<Field>& defaults, ConfigContext context,
                        bool examples) {
  std::vector<std::string> tables;
  for (const Field& field : shown) {
    if (std::find(tables.begin(), tables.end(), table_of(field)) == tables.end()) tables.push_back(table_of(field));
  }
  std::string text;
  for (const std::string& table : tables) {
    std::string lines;
    for (std::size_t i = 0; i < shown.size(); ++i) {
      const Field& field = shown[i];
      if (table_of(field) != table || !field.allowed(context)) continue;
      const bool has_default = field.example.empty();
      lines += "# " + field.meaning + range_text(field);
      lines += has_default ? "; default " + toml_value(defaults[i].target) : "; NO DEFAULT: set it for your car";
      const std::string leaf = table.empty() ? field.key : field.key.substr(table.size() + 1);
      lines += "\n" + leaf + " = " + (examples && !has_default ? field.example : toml_value(field.target)) + "\n";
    }
    if (lines.empty()) continue;
    const std::string meaning = table_meaning(table);
    if (!table.empty()) text += "\n[" + table + "]" + (meaning.empty() ? "" : "  # " + meaning) + "\n";
    text += lines;
  }
  return text;
}

Settings all_tables() {
  Settings settings;
  settings.vehicle.emplace();
  settings.imu.emplace();
  settings.anchor.emplace();
  return settings;
}

}  // namespace

std::string config_text(const Settings& settings, ConfigContext context) {
  Settings shown = settings;
  Settings defaults = all_tables();
  if (!settings.vehicle) defaults.vehicle.reset();
  if (!settings.imu) defaults.imu.reset();
  if (!settings.anchor) defaults.anchor.reset();
  return tables_text(fields_of(shown), fields_of(defaults), context, false);
}

std::vector<KeyChange> changed_keys(const Settings& before, const Settings& after) {
  Settings old_settings = before, new_settings = after;
  std::vector<KeyChange> changes;
  for (const Field& field : fields_of(old_settings)) changes.push_back({field.key, toml_value(field.target), ""});
  for (const Field& field : fields_of(new_settings)) {
    const auto same = [&](const KeyChange& change) { return change.key == field.key; };
    auto found = std::find_if(changes.begin(), changes.end(), same);
    if (found == changes.end()) found = changes.insert(found, {field.key, "", ""});
    found->after = toml_value(field.target);
  }
  std::erase_if(changes, [](const KeyChange& change) { return change.before == change.after; });
  return changes;
}

std::string default_config_text() {
  Settings defaults = all_tables();
  const std::vector<Field> fields = fields_of(defaults);
  return "# Configuration of roadvecd: every key there is, with its range, default and meaning. The ending of a key is "
         "its unit.\n"
         "# Keys marked NO DEFAULT show an example and must be set for your car; all others may be left out.\n"
         "# Paths are relative to this file. Check with: roadvecd --config FILE --check-config\n" +
         tables_text(fields, fields, ConfigContext::car, true);
}

}  // namespace roadvec
