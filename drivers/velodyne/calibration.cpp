#include "drivers/velodyne/calibration.h"

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>

#include "core/base/angle.h"
#include "drivers/velodyne/calibration_text.h"

namespace roadvec {

Expected<Calibration> load_calibration(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (!file.is_open() || file.bad()) {
    return fail(path.string() + ": cannot read the calibration file (" + std::strerror(errno) +
                "); check `calibration`");
  }
  const bool is_xml = path.extension() == ".xml" || trimmed(text).starts_with('<');
  return is_xml ? parse_db_xml(text, path.string()) : parse_calibration_yaml(text, path.string());
}

std::optional<Calibration> built_in_calibration(LidarModel model) {
  const ModelFacts& facts = facts_of(model);
  if (facts.elevations_deg.empty()) return std::nullopt;
  Calibration calibration;
  for (std::size_t laser = 0; laser < facts.elevations_deg.size(); ++laser) {
    const float rotation_deg =
        facts.rotations_deg.empty() ? 0 : facts.rotations_deg[laser % facts.rotations_deg.size()];
    calibration.lasers.push_back({.rotation_rad = rad_from_deg(static_cast<double>(rotation_deg)),
                                  .elevation_rad = rad_from_deg(static_cast<double>(facts.elevations_deg[laser]))});
  }
  return calibration;
}

Expected<Calibration> fit_to_model(Calibration calibration, LidarModel model, std::string_view name) {
  const ModelFacts& facts = facts_of(model);
  const auto laser_count = static_cast<std::size_t>(facts.laser_count);
  // Files for smaller heads keep 64 entries and disable those that are not there.
  std::size_t used_count = calibration.lasers.size();
  while (used_count > laser_count && !calibration.lasers[used_count - 1].enabled) --used_count;
  if (used_count != laser_count) {
    return fail(std::string(name) + ": has " + std::to_string(used_count) + " lasers, but a " +
                std::string(facts.name) + " has " + std::to_string(laser_count) + "; check `model` and `calibration`");
  }
  calibration.lasers.resize(laser_count);
  const double lsb_m = calibration.distance_lsb_m.value_or(facts.distance_lsb_m);
  if (std::abs(lsb_m - facts.distance_lsb_m) > 1e-6) {
    return fail(std::string(name) + ": its distance step does not fit a " + std::string(facts.name) +
                ", which counts distance in steps of " +
                std::to_string(static_cast<int>(std::lround(facts.distance_lsb_m * 1000))) +
                " mm; check `model` and `calibration`");
  }
  return calibration;
}

Expected<Calibration> calibration_for(LidarModel model, const std::filesystem::path& file) {
  if (file == kStreamedCalibration) {
    if (facts_of(model).needs_calibration()) return Calibration{.streamed = true};
    return fail("a " + std::string(name_of(model)) + " does not stream its calibration; leave `calibration` empty");
  }
  if (!file.empty()) {
    return load_calibration(file).and_then(
        [&](Calibration loaded) { return fit_to_model(std::move(loaded), model, file.string()); });
  }
  if (std::optional<Calibration> built_in = built_in_calibration(model)) return *std::move(built_in);
  return fail("a " + std::string(name_of(model)) +
              " needs the calibration of its own lasers; set `calibration` to its db.xml, or to \"streamed\"");
}

}  // namespace roadvec
