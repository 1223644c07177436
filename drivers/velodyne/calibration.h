#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "drivers/velodyne/model.h"

namespace roadvec {

/// How one laser differs from an ideal one. Signs as in the maker's file: see decode.h for the formula that uses them.
struct LaserCalibration {
  bool enabled = true;
  double rotation_rad = 0, elevation_rad = 0;
  double distance_m = 0;                      ///< added to every distance (far calibration, at 25.04 m)
  double distance_x_m = 0, distance_y_m = 0;  ///< near calibration at 2.4 m and 1.93 m; either 0: none
  double vertical_offset_m = 0, horizontal_offset_m = 0;
  double focal_distance_m = 0, focal_slope = 0;  ///< intensity
  double min_intensity = 0, max_intensity = 255;
};

struct Calibration {
  std::optional<double> distance_lsb_m{};  ///< empty: the file does not say, the model's own value holds
  std::vector<LaserCalibration> lasers{};  ///< by laser number
  bool streamed = false;                   ///< comes with an HDL-64E's packets; there are no lasers yet
};

/// In place of a file's name: the table that an HDL-64E streams in its packets.
inline constexpr const char* kStreamedCalibration = "streamed";

/// Velodyne's db.xml. `name` is said in errors. Takes any bytes; the order of the file's lasers does not matter, their
/// numbers do.
[[nodiscard]] Expected<Calibration> parse_db_xml(std::string_view text, std::string_view name);
/// The YAML of ROS' velodyne_pointcloud, likewise.
[[nodiscard]] Expected<Calibration> parse_calibration_yaml(std::string_view text, std::string_view name);
/// Either: XML by the file's extension or its first character, else YAML.
[[nodiscard]] Expected<Calibration> load_calibration(const std::filesystem::path& path);

/// The angles that are the same for every head of a model but the HDL-64E. Empty for a model whose heads differ from
/// one another.
[[nodiscard]] std::optional<Calibration> built_in_calibration(LidarModel model);

/// What the decoder of `model` takes: the calibration in `file`, the built-in angles when `file` is empty, what the
/// sensor streams when it is kStreamedCalibration. Errors: no file for a model that needs one; a file made for another
/// model.
[[nodiscard]] Expected<Calibration> calibration_for(LidarModel model, const std::filesystem::path& file);
/// The same check for a calibration already in memory; unused lasers at the end are cut off. `name` is said in errors.
[[nodiscard]] Expected<Calibration> fit_to_model(Calibration calibration, LidarModel model, std::string_view name);

}  // namespace roadvec
