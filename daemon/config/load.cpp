#include "daemon/config/load.h"

#include <arpa/inet.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <numeric>

#include "daemon/config/assign.h"

namespace roadvec {
namespace {

constexpr std::size_t kLargestFileBytes = 1 << 20;

/// Levenshtein distance.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

/// The known key, or table, most like `key`; empty if none is alike.
std::string nearest_key(const std::string& key, const std::vector<Field>& fields, ConfigContext context) {
  std::string nearest;
  std::size_t least = std::max<std::size_t>(2, key.size() / 3) + 1;
  if (key.size() > 100) return nearest;
  const auto consider = [&](const std::string& known) {
    const std::size_t distance = edit_distance(key, known);
    if (distance < least) least = distance, nearest = known;
  };
  for (const Field& field : fields) {
    if (!field.allowed(context)) continue;
    consider(field.key);
    for (std::size_t dot = field.key.find('.'); dot != std::string::npos; dot = field.key.find('.', dot + 1)) {
      consider(field.key.substr(0, dot));
    }
  }
  return nearest;
}

std::string unknown_key(const std::string& key, const std::vector<Field>& fields, ConfigContext context) {
  const std::string nearest = nearest_key(key, fields, context);
  return nearest.empty() ? "unknown; remove it (all keys: roadvecd --print-config)"
                         : "unknown; did you mean '" + nearest + "'?";
}

/// Objects to every key below `table` that no field has, or that does not belong into this kind of file.
void check_keys(const toml::table& table, const std::string& prefix, const std::vector<Field>& fields,
                ConfigContext context, ConfigDocument& document) {
  for (const auto& [name, value] : table) {
    const std::string key = prefix + std::string(name.str());
    const auto field = std::find_if(fields.begin(), fields.end(), [&](const Field& f) { return f.key == key; });
    if (name.str().find('.') != std::string_view::npos) {  // a quoted key: not the same as a key in a table
      document.object(key, "has a dot inside quotes; write the keys below [table]", &value);
      continue;
    }
    const bool is_table =
        std::any_of(fields.begin(), fields.end(), [&](const Field& f) { return f.key.starts_with(key + "."); });
    if (field != fields.end()) {
      if (field->allowed(context)) continue;
      document.object(key, context == ConfigContext::drive
                               ? "does not belong into a drive; move it to a configuration file"
                               : "belongs into the drive.toml of a drive; remove it");
    } else if (is_table && value.is_table()) {
      check_keys(*value.as_table(), key + ".", fields, context, document);
    } else if (is_table) {
      document.object(key, "is not a table; write [" + key + "] on a line of its own and the keys below it");
    } else {
      document.object(key, unknown_key(key, fields, context));
    }
  }
}

void check_required(const std::vector<Field>& fields, ConfigContext context, ConfigDocument& document) {
  std::string missing_table;
  for (const Field& field : fields) {
    if (!field.required || !field.allowed(context) || document.find(field.key)) continue;
    const std::string table = field.key.substr(0, field.key.rfind('.'));
    if (document.find(table)) {
      document.object(field.key, "missing; add it: " + field.meaning + "; for example " +
                                     field.key.substr(table.size() + 1) + " = " + field.example);
    } else if (table != missing_table) {
      document.object(table, "the table is missing; add [" + table + "]: " + table_meaning(table));
      missing_table = table;
    }
  }
}

void check_imu(const Settings& settings, ConfigContext context, ConfigDocument& document) {
  const ImuSettings& imu = *settings.imu;
  if (imu.protocol == ImuProtocol::can) {
    const SignalSettings* signals[] = {&imu.rate_z_signal, &imu.heading_signal};
    if (std::all_of(std::begin(signals), std::end(signals), [](const auto* s) { return s->sum.empty(); })) {
      document.object("imu.rate_z_signal", "protocol \"can\" needs it, or heading_signal; name a signal of the DBC");
    }
    if (imu.can.empty() && !settings.vehicle)
      document.object("imu.can", "missing; without [vehicle], name the interface here");
    if (imu.dbc.empty() && !settings.vehicle)
      document.object("imu.dbc", "missing; without [vehicle], name the DBC file here");
  } else if (context == ConfigContext::drive && !document.find("imu.log")) {
    document.object("imu.log", "missing; name the recorded messages, for example log = \"imu.log\"");
  } else if (context == ConfigContext::car && imu.protocol == ImuProtocol::xsens && imu.device.empty()) {
    document.object("imu.device", "missing; name the serial line, for example device = \"/dev/ttyUSB0\"");
  }
}

void check_together(const Settings& settings, ConfigContext context, ConfigDocument& document) {
  in_addr address{};
  if (const std::string& source = settings.lidar.source_address;
      !source.empty() && ::inet_pton(AF_INET, source.c_str(), &address) != 1) {
    document.object("lidar.source_address", "\"" + source + "\" is not an IPv4 address; write it as 192.168.1.201");
  }
  if (context == ConfigContext::overrides) return;
  if (!settings.vehicle && !settings.imu) {
    document.object("vehicle", "neither [vehicle] nor [imu] is there; add at least one, the motion comes from it");
  }
  const toml::node* const wheels = document.find("vehicle.wheel_speed_signals");
  if (!settings.imu && wheels && wheels->is_array() && wheels->as_array()->empty()) {
    document.object("vehicle.wheel_speed_signals",
                    "names no signal and there is no [imu]; the motion must come from one of them");
  }
  if (settings.imu) check_imu(settings, context, document);
}

Expected<std::string> read_text(const std::filesystem::path& file) {
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  std::string text(kLargestFileBytes + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (stream.bad() || !stream.is_open() || (stream.gcount() == 0 && errno != 0)) {
    return fail(file.native() + ": cannot read: " + std::strerror(errno) + "; name an existing TOML file");
  }
  text.resize(static_cast<std::size_t>(stream.gcount()));
  if (text.size() > kLargestFileBytes)
    return fail(file.native() + ": larger than 1 MiB; this is not a configuration file");
  return text;
}

Expected<Settings> load(const std::filesystem::path& file, ConfigContext context, Settings base) {
  const auto text = read_text(file);
  if (!text) return tl::make_unexpected(text.error());
  const auto folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
  return parse_settings(*text, file.native(), folder, context, std::move(base));
}

void take_if_there(std::filesystem::path& path, const std::filesystem::path& usual) {
  std::error_code error;
  if (path.empty() && std::filesystem::exists(usual, error)) path = usual;
}

}  // namespace

Expected<Settings> parse_settings(std::string_view text, const std::string& name, const std::filesystem::path& folder,
                                  ConfigContext context, Settings base) {
  auto document = ConfigDocument::parse(text, name);
  if (!document) return tl::make_unexpected(document.error());
  Settings settings = std::move(base);
  const toml::table& root = document->root();
  if (root.contains("vehicle")) settings.vehicle.emplace();
  if (root.contains("imu")) settings.imu.emplace();
  if (root.contains("anchor")) settings.anchor.emplace();

  // Keys are judged against every table there is, also those this file leaves out.
  Settings every_table = settings;
  every_table.vehicle.emplace();
  every_table.imu.emplace();
  every_table.anchor.emplace();
  check_keys(root, "", fields_of(every_table), context, *document);

  const std::vector<Field> fields = fields_of(settings);
  for (const Field& field : fields) {
    const toml::node* value = field.allowed(context) ? document->find(field.key) : nullptr;
    if (value) assign(field, *value, folder, context, *document);
  }
  if (context != ConfigContext::overrides) check_required(fields, context, *document);
  check_together(settings, context, *document);
  if (!document->faultless()) return tl::make_unexpected(document->error());
  return settings;
}

Expected<Settings> load_settings(const std::filesystem::path& file) { return load(file, ConfigContext::car, {}); }

Expected<Settings> load_drive(const std::filesystem::path& dir, const std::optional<std::filesystem::path>& overrides) {
  Settings base;
  if (overrides) {
    auto loaded = load(*overrides, ConfigContext::overrides, {});
    if (!loaded) return loaded;
    base = std::move(*loaded);
    base.lidar = {};
    base.vehicle.reset();
    base.imu.reset();
    base.anchor.reset();
  }
  auto settings = load(dir / "drive.toml", ConfigContext::drive, std::move(base));
  if (!settings) return settings;
  take_if_there(settings->truth.poses, dir / "truth" / "poses.tum");
  take_if_there(settings->truth.boundaries, dir / "truth" / "boundaries.geojson");
  return settings;
}

}  // namespace roadvec
