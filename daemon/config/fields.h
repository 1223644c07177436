#pragma once

#include <concepts>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "daemon/config/settings.h"

namespace roadvec {

/// Which file is read: the car's configuration, a drive's drive.toml, or a configuration file that goes with a drive
/// (its sensor tables are checked but not used, and nothing in it is required).
enum class ConfigContext : std::uint8_t { car, drive, overrides };

/// What the value of a text key names.
enum class Names : std::uint8_t {
  nothing,
  input_file,
  calibration,  ///< an input file, or kStreamedCalibration
  output_file,
  can_source
};

/// An enumeration under its names in the file. `value` views an enum whose underlying type is std::uint8_t.
struct Choice {
  std::uint8_t* value;
  std::span<const char* const> names;
};

using FieldTarget = std::variant<double*, int*, bool*, std::string*, std::filesystem::path*, Choice, SignalSettings*,
                                 std::vector<SignalSettings>*, std::vector<MessageSettings>*>;

/// One key of the configuration: all that the parser, the checks and the printed text need to know about it.
struct Field {
  std::string key;  ///< "table.name_unit"
  FieldTarget target;
  double min = 0, max = 0;  ///< of numbers
  std::string meaning;
  std::span<const char* const> choices = {};  ///< of text; empty: any
  Names names = Names::nothing;
  bool required = false;     ///< wherever it is allowed
  bool in_car = true;        ///< allowed in a configuration file
  bool in_drive = false;     ///< allowed in drive.toml
  std::string example = {};  ///< TOML value shown in config/roadvecd.toml: depends on the car, has no useful default

  Field& is_required(std::string example_value);
  Field& for_example(std::string example_value);
  Field& only_in_car();
  Field& only_in_drive();
  Field& naming(Names what);
  Field& one_of(std::span<const char* const> texts);
  [[nodiscard]] bool allowed(ConfigContext context) const {
    return context == ConfigContext::drive ? in_drive : in_car;
  }
};

/// The visitor: collects the fields it is called with. The first two forms are those of core/pipeline/config.h.
class FieldList {
 public:
  Field& operator()(std::string key, double& value, double min, double max, std::string meaning);
  Field& operator()(std::string key, int& value, double min, double max, std::string meaning);
  Field& operator()(std::string key, bool& value, std::string meaning);
  Field& operator()(std::string key, std::string& value, std::string meaning);
  Field& operator()(std::string key, std::filesystem::path& value, std::string meaning);
  Field& operator()(std::string key, SignalSettings& value, std::string meaning);
  Field& operator()(std::string key, std::vector<SignalSettings>& value, std::string meaning);
  Field& operator()(std::string key, std::vector<MessageSettings>& value, std::string meaning);
  template <class E>
  requires std::is_enum_v<E> && std::same_as<std::underlying_type_t<E>, std::uint8_t> Field& operator()(
      std::string key, E& value, std::span<const char* const> names, std::string meaning) {
    return add(std::move(key), Choice{reinterpret_cast<std::uint8_t*>(&value), names}, 0, 0, std::move(meaning));
  }

  void sensors_begin() { sensor_table_ = true; }  ///< fields from here on are allowed in drive.toml too
  void sensors_end() { sensor_table_ = false; }
  [[nodiscard]] std::vector<Field> take() { return std::move(fields_); }

 private:
  Field& add(std::string key, FieldTarget target, double min, double max, std::string meaning);
  std::vector<Field> fields_;
  bool sensor_table_ = false;
};

/// Every key there is, in the order of the printed text, bound to the values in `settings`; tables it lacks are left
/// out.
[[nodiscard]] std::vector<Field> fields_of(Settings& settings);

/// What a table is for, one line; empty for the steps of the method, whose keys speak for themselves.
[[nodiscard]] std::string table_meaning(std::string_view table);

}  // namespace roadvec
