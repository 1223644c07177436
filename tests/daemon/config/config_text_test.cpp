#include "daemon/config/config_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>

#include "daemon/config/load.h"

namespace roadvec {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

const fs::path kShipped = fs::path(ROADVEC_SOURCE) / "config" / "roadvecd.toml";

std::string text_of(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

/// Every value moved off its default, inside its range: nothing may be lost on the way through text.
Settings changed_everywhere() {
  Settings settings;
  settings.vehicle.emplace();
  settings.imu.emplace();
  settings.anchor.emplace();
  struct {
    double part = 0.3;
    const Field* field = nullptr;
    void operator()(double* v) {
      *v = field->min + (field->max - field->min) * (part = part < 0.9 ? part + 0.017 : 0.3);
    }
    void operator()(int* v) { *v = static_cast<int>(field->min + (field->max - field->min) / 3.0); }
    void operator()(bool* v) { *v = !*v; }
    void operator()(std::string* v) { *v = field->choices.empty() ? "a \"quoted\" \\ text" : field->choices.back(); }
    void operator()(fs::path* v) { *v = "/dev/null"; }
    void operator()(const Choice& v) { *v.value = static_cast<std::uint8_t>(v.names.size() - 1); }
    void operator()(SignalSettings* v) {
      *v = {.sum = {"A.B", "C.D"},
            .sign = "E.F",
            .valid = "G.H",
            .unit = "km/h",
            .scale = -1e-7,
            .valid_raw = 3,
            .invalid_raw = 65535};
    }
    void operator()(std::vector<SignalSettings>* v) {
      v->resize(2);
      v->front().sum = {"A.B"};
      v->back().sum = {"A.C", "A.D"};
    }
    void operator()(std::vector<MessageSettings>* v) {
      *v = {{.message = "A", .counter = "B", .checksum = "C", .kind = ChecksumKind::honda, .timeout_ms = 12.5},
            {.message = "D", .counter = "", .checksum = "", .kind = ChecksumKind::none, .timeout_ms = 0}};
    }
  } change;
  for (const Field& field : fields_of(settings)) {
    change.field = &field;
    std::visit(change, field.target);
  }
  settings.lidar.source_address = "192.168.1.201";
  settings.vehicle->can = settings.imu->can = "/dev/null";
  return settings;
}

TEST(ConfigText, shipped_file_is_what_the_program_prints) {
  if (std::getenv("ROADVEC_REGENERATE")) std::ofstream(kShipped) << default_config_text();
  EXPECT_EQ(text_of(kShipped), default_config_text())
      << "config/roadvecd.toml is generated: run `roadvecd --print-config > config/roadvecd.toml`, or this test with "
         "ROADVEC_REGENERATE=1 in the environment";
}

TEST(ConfigText, shipped_file_loads) {
  const auto settings = load_settings(kShipped);
  ASSERT_TRUE(settings) << settings.error().message;
  EXPECT_TRUE(settings->vehicle && settings->imu && settings->anchor);
  EXPECT_EQ(settings->pipeline.simplify.tolerance_m, PipelineConfig{}.simplify.tolerance_m);
}

TEST(ConfigText, reads_back_as_the_same_settings) {
  for (const ConfigContext context : {ConfigContext::car, ConfigContext::drive}) {
    const std::string text = config_text(changed_everywhere(), context);
    const auto settings = parse_settings(text, "printed.toml", "/", context);
    ASSERT_TRUE(settings) << settings.error().message << "\n" << text;
    EXPECT_EQ(config_text(*settings, context), text);
  }
}

TEST(ConfigText, leaves_out_the_tables_that_are_not_there) {
  Settings settings = changed_everywhere();
  settings.imu.reset();
  EXPECT_THAT(config_text(settings), HasSubstr("[vehicle]"));
  EXPECT_THAT(config_text(settings), ::testing::Not(HasSubstr("\n[imu]")));
  EXPECT_THAT(config_text(settings, ConfigContext::drive), ::testing::Not(HasSubstr("\n[simplify]")));
}

TEST(ConfigText, every_key_has_range_default_and_meaning) {
  EXPECT_THAT(default_config_text(), HasSubstr("# largest distance of a dropped vertex from the kept line; 0.005 to "
                                               "1.0; default 0.06\ntolerance_m = 0.06\n"));
  EXPECT_THAT(default_config_text(),
              HasSubstr("# height above the road; 0.0 to 10.0; NO DEFAULT: set it for your car\nz_m = 1.73\n"));
  EXPECT_THAT(default_config_text(), HasSubstr("; \"arrival\" | \"device\" | \"device_utc\"; default \"arrival\"\n"));
}

TEST(ConfigFields, are_sound) {
  Settings settings;
  settings.vehicle.emplace();
  settings.imu.emplace();
  settings.anchor.emplace();
  std::set<std::string> keys;
  for (const Field& field : fields_of(settings)) {
    EXPECT_TRUE(keys.insert(field.key).second) << field.key << " twice";
    EXPECT_FALSE(field.meaning.empty()) << field.key;
    EXPECT_TRUE(field.in_car || field.in_drive) << field.key;
    EXPECT_EQ(field.meaning.find('\n'), std::string::npos) << field.key;
    if (const auto* number = std::get_if<double*>(&field.target); number && field.example.empty()) {
      EXPECT_TRUE(**number >= field.min && **number <= field.max) << field.key << ": default out of range";
    }
    if (const auto* number = std::get_if<int*>(&field.target)) {
      EXPECT_TRUE(**number >= field.min && **number <= field.max) << field.key << ": default out of range";
    }
  }
}

TEST(ConfigText, changed_keys_are_named_with_what_they_were_and_are) {
  Settings before, after;
  before.vehicle.emplace();
  after.imu.emplace();
  before.log.level = LogLevel::debug;
  after.lidar.port = 2400;
  const std::vector<KeyChange> changes = changed_keys(before, after);
  const auto change_of = [&](const std::string& key) {
    const auto found = std::find_if(changes.begin(), changes.end(), [&](const KeyChange& c) { return c.key == key; });
    return found == changes.end() ? "" : found->before + " -> " + found->after;
  };
  EXPECT_EQ(change_of("log.level"), "\"debug\" -> \"info\"");
  EXPECT_EQ(change_of("lidar.port"), "2368 -> 2400");
  EXPECT_EQ(change_of("vehicle.track_m"), "0.0 -> ");
  EXPECT_EQ(change_of("imu.baud"), " -> 115200");
  EXPECT_EQ(change_of("lidar.model"), "");
  EXPECT_TRUE(changed_keys(after, after).empty());
}

}  // namespace
}  // namespace roadvec
