#include <yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "drivers/velodyne/calibration_text.h"

namespace roadvec {
namespace {

constexpr const char* kYamlRemedy = "; use the YAML file that velodyne_pointcloud reads, or the sensor's db.xml";

/// Keys of one laser, in metres and radians. [ros-drivers/velodyne] Its converter skips zeros in the lists of least and
/// greatest intensity, so that these may be another laser's: db.xml is the better source.
constexpr std::array<std::pair<std::string_view, double LaserCalibration::*>, 11> kNumbers{{
    {"rot_correction", &LaserCalibration::rotation_rad},
    {"vert_correction", &LaserCalibration::elevation_rad},
    {"dist_correction", &LaserCalibration::distance_m},
    {"dist_correction_x", &LaserCalibration::distance_x_m},
    {"dist_correction_y", &LaserCalibration::distance_y_m},
    {"vert_offset_correction", &LaserCalibration::vertical_offset_m},
    {"horiz_offset_correction", &LaserCalibration::horizontal_offset_m},
    {"focal_distance", &LaserCalibration::focal_distance_m},
    {"focal_slope", &LaserCalibration::focal_slope},
    {"min_intensity", &LaserCalibration::min_intensity},
    {"max_intensity", &LaserCalibration::max_intensity},
}};
constexpr std::size_t kRequired = 2;  ///< the first of them
/// What the converter from db.xml writes where that lacks its distLSB_: a hundred times too much.
constexpr double kConverterFault_m = 0.2;

/// The events of one document; the first thing wrong with it stays in `error` and ends the reading.
class YamlReader {
 public:
  YamlReader(std::string_view text, std::string_view name) : name_(name) {
    yaml_parser_initialize(&parser_);
    yaml_parser_set_input_string(&parser_, reinterpret_cast<const unsigned char*>(text.data()), text.size());
    next();
  }
  YamlReader(const YamlReader&) = delete;
  YamlReader& operator=(const YamlReader&) = delete;
  ~YamlReader() {
    yaml_event_delete(&event_);
    yaml_parser_delete(&parser_);
  }

  Expected<Calibration> run() {
    if (at(YAML_STREAM_START_EVENT)) next();
    if (at(YAML_DOCUMENT_START_EVENT)) next();
    if (ok() && !at(YAML_MAPPING_START_EVENT)) complain("is not a YAML mapping");
    Calibration calibration;
    read_mapping([&](const std::string& key) {
      if (key == "distance_resolution") return read_resolution(calibration);
      if (key == "lasers") return read_lasers(calibration.lasers);
      skip();
    });
    if (ok() && calibration.lasers.empty()) complain("has no lasers: this is not a Velodyne calibration file");
    if (!ok()) return fail(error_);
    return calibration;
  }

 private:
  [[nodiscard]] bool ok() const { return error_.empty(); }
  [[nodiscard]] bool at(yaml_event_type_t type) const { return ok() && event_.type == type; }
  [[nodiscard]] std::string here() const { return "line " + std::to_string(event_.start_mark.line + 1); }
  [[nodiscard]] std::string_view scalar() const {
    return {reinterpret_cast<const char*>(event_.data.scalar.value), event_.data.scalar.length};
  }
  void complain(const std::string& what) {
    if (ok()) error_ = std::string(name_) + ": " + what + kYamlRemedy;
  }

  void next() {
    yaml_event_delete(&event_);
    if (yaml_parser_parse(&parser_, &event_) != 0) return;
    event_ = {};
    complain("not YAML (" + std::string(parser_.problem != nullptr ? parser_.problem : "damaged") + " in line " +
             std::to_string(parser_.problem_mark.line + 1) + ")");
  }
  /// The value that begins here, however deep.
  void skip() {
    int depth = 0;
    do {
      if (at(YAML_MAPPING_START_EVENT) || at(YAML_SEQUENCE_START_EVENT)) ++depth;
      if (at(YAML_MAPPING_END_EVENT) || at(YAML_SEQUENCE_END_EVENT)) --depth;
      next();
    } while (ok() && depth > 0);
  }
  /// `read(key)` consumes the value.
  template <class Read>
  void read_mapping(Read read) {
    if (!ok()) return;
    next();
    while (ok() && !at(YAML_MAPPING_END_EVENT)) {
      if (!at(YAML_SCALAR_EVENT)) return complain(here() + ": a key is expected");
      const std::string key(scalar());
      next();
      if (ok()) read(key);
    }
    next();
  }

  double read_number(const std::string& key) {
    const std::optional<double> maybe_number = at(YAML_SCALAR_EVENT) ? number_in(scalar()) : std::nullopt;
    if (!maybe_number) complain(here() + ": " + key.substr(0, 40) + " is not a number");
    next();
    return maybe_number.value_or(0);
  }
  bool read_flag(const std::string& key) {
    const bool yes = at(YAML_SCALAR_EVENT) && scalar() == "true", no = at(YAML_SCALAR_EVENT) && scalar() == "false";
    if (!yes && !no) complain(here() + ": " + key + " is neither true nor false");
    next();
    return yes;
  }

  void read_resolution(Calibration& calibration) {
    const double lsb_m = read_number("distance_resolution");
    if (lsb_m == kConverterFault_m) return;
    if (!(lsb_m > 0.0 && lsb_m <= 0.01)) complain("distance_resolution is not in (0, 0.01] metres");
    calibration.distance_lsb_m = lsb_m;
  }

  void read_lasers(std::vector<LaserCalibration>& lasers) {
    if (!at(YAML_SEQUENCE_START_EVENT)) return complain(here() + ": lasers is not a list");
    std::vector<std::pair<double, LaserCalibration>> numbered;
    for (next(); ok() && !at(YAML_SEQUENCE_END_EVENT);) {
      if (!at(YAML_MAPPING_START_EVENT)) return complain(here() + ": a laser is not a mapping");
      if (numbered.size() == kMostLasers) return complain("has more than 128 lasers");
      numbered.push_back(read_laser());
    }
    next();
    if (!ok()) return;
    std::ranges::sort(numbered, {}, [](const auto& entry) { return entry.first; });
    lasers.clear();
    for (const auto& [id, laser] : numbered) {
      if (id != static_cast<double>(lasers.size())) {
        return complain("laser_id " + std::to_string(lasers.size()) + " is missing, or another one occurs twice");
      }
      lasers.push_back(laser);
    }
  }

  std::pair<double, LaserCalibration> read_laser() {
    const std::string where = here();
    LaserCalibration laser;
    double id = -1;
    std::size_t required_count = 0;
    bool two_point = true;
    read_mapping([&](const std::string& key) {
      const auto* const number = std::ranges::find(kNumbers, key, [](const auto& entry) { return entry.first; });
      if (key == "laser_id") {
        id = read_number(key);
      } else if (key == "two_pt_correction_available") {
        two_point = read_flag(key);
      } else if (number != kNumbers.end()) {
        laser.*number->second = read_number(key);
        required_count += number < kNumbers.data() + kRequired ? 1 : 0;
      } else {
        skip();
      }
    });
    // Converters never wrote the flag, so that its absence says nothing [ros-drivers/velodyne #109].
    if (!two_point) laser.distance_x_m = laser.distance_y_m = 0;
    if (id < 0 || required_count < kRequired) {
      complain(where + ": the laser lacks laser_id, rot_correction or vert_correction");
    }
    if (const char* problem = implausible(laser))
      complain(where + ": " + problem + " (radians and metres are expected)");
    return {id, laser};
  }

  std::string_view name_;
  yaml_parser_t parser_{};
  yaml_event_t event_{};
  std::string error_;
};

}  // namespace

Expected<Calibration> parse_calibration_yaml(std::string_view text, std::string_view name) {
  return YamlReader(text, name).run();
}

}  // namespace roadvec
