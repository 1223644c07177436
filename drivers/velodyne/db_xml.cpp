#include <cmath>
#include <iterator>
#include <pugixml.hpp>
#include <string>

#include "core/base/angle.h"
#include "drivers/velodyne/calibration_text.h"

namespace roadvec {
namespace {

constexpr const char* kXmlRemedy = "; use the db.xml that came with this sensor";

/// Reads one file; the first thing wrong with it stays in `error` and every later read is void.
class DbXmlReader {
 public:
  DbXmlReader(pugi::xml_node db, std::string_view name) : db_(db), name_(name) {}

  Expected<Calibration> run() {
    Calibration calibration;
    if (db_.child("distLSB_")) {
      const double lsb_cm = number(db_, "distLSB_", "DB");
      if (error_.empty() && !(lsb_cm > 0.0 && lsb_cm <= 1.0)) {
        complain("<distLSB_> is " + std::string(trimmed(db_.child_value("distLSB_"))) + ", not in (0, 1] centimetres");
      }
      calibration.distance_lsb_m = lsb_cm / 100.0;
    }
    read_lasers(calibration.lasers);
    read_list("enabled_", calibration.lasers, [](LaserCalibration& laser, double v) { laser.enabled = v != 0; });
    read_list("minIntensity_", calibration.lasers, [](LaserCalibration& laser, double v) { laser.min_intensity = v; });
    read_list("maxIntensity_", calibration.lasers, [](LaserCalibration& laser, double v) { laser.max_intensity = v; });
    if (!error_.empty()) return fail(error_);
    return calibration;
  }

 private:
  void complain(const std::string& what) {
    if (error_.empty()) error_ = std::string(name_) + ": " + what + kXmlRemedy;
  }

  /// Newer files hold intensities as floats, so every number is read as one. [ros-drivers/velodyne #84]
  double parse(const char* text, const std::string& where) {
    const std::optional<double> maybe_number = number_in(text);
    if (!maybe_number) complain(where + " is \"" + std::string(trimmed(text)).substr(0, 40) + "\", not a number");
    return maybe_number.value_or(0);
  }
  double number(pugi::xml_node parent, const char* element, const std::string& where) {
    const pugi::xml_node node = parent.child(element);
    if (!node) {
      complain(where + ": element <" + element + "> is missing");
      return 0;
    }
    return parse(node.child_value(), where + ": <" + element + ">");
  }
  double number_or_zero(pugi::xml_node parent, const char* element, const std::string& where) {
    return parent.child(element) ? number(parent, element, where) : 0.0;
  }

  void read_lasers(std::vector<LaserCalibration>& lasers) {
    const pugi::xml_node points = db_.child("points_");
    if (!points) return complain("element <points_> is missing: this is not a Velodyne calibration file");
    const auto items = points.children("item");
    const auto count = static_cast<std::size_t>(std::distance(items.begin(), items.end()));
    if (count == 0 || count > kMostLasers) return complain("<points_> has " + std::to_string(count) + " items");
    check_count(points, count);
    lasers.resize(count);
    std::vector<bool> seen(count, false);
    std::size_t item = 0;
    for (const pugi::xml_node node : items) {
      const std::string where = "<points_> item " + std::to_string(item++);
      const double id = number(node.child("px"), "id_", where);
      if (!error_.empty()) return;
      if (id != std::floor(id) || id < 0 || id >= static_cast<double>(count)) {
        return complain(where + ": <id_> is " + std::string(trimmed(node.child("px").child_value("id_"))) +
                        ", not a laser of 0.." + std::to_string(count - 1));
      }
      const auto laser = static_cast<std::size_t>(id);
      if (seen[laser]) return complain(where + ": <id_> " + std::to_string(laser) + " occurs twice");
      seen[laser] = true;
      read_laser(node.child("px"), where, lasers[laser]);
    }
  }

  void read_laser(pugi::xml_node px, const std::string& where, LaserCalibration& laser) {
    laser.rotation_rad = rad_from_deg(number(px, "rotCorrection_", where));
    laser.elevation_rad = rad_from_deg(number(px, "vertCorrection_", where));
    laser.distance_m = number(px, "distCorrection_", where) / 100.0;
    // The rest came with later revisions of the file; without them the effect they correct is not corrected.
    laser.distance_x_m = number_or_zero(px, "distCorrectionX_", where) / 100.0;
    laser.distance_y_m = number_or_zero(px, "distCorrectionY_", where) / 100.0;
    laser.vertical_offset_m = number_or_zero(px, "vertOffsetCorrection_", where) / 100.0;
    laser.horizontal_offset_m = number_or_zero(px, "horizOffsetCorrection_", where) / 100.0;
    laser.focal_distance_m = number_or_zero(px, "focalDistance_", where) / 100.0;
    laser.focal_slope = number_or_zero(px, "focalSlope_", where);
    if (const char* problem = implausible(laser))
      complain(where + ": " + problem + " (degrees and centimetres are expected)");
  }

  template <class Set>
  void read_list(const char* element, std::vector<LaserCalibration>& lasers, Set set) {
    const pugi::xml_node list = db_.child(element);
    if (!list || !error_.empty()) return;
    const auto items = list.children("item");
    const auto count = static_cast<std::size_t>(std::distance(items.begin(), items.end()));
    check_count(list, count);
    if (count != lasers.size()) {
      return complain(std::string("<") + element + "> has " + std::to_string(count) + " items for " +
                      std::to_string(lasers.size()) + " lasers");
    }
    std::size_t laser = 0;
    for (const pugi::xml_node item : items) {
      const std::string where = std::string("<") + element + "> item " + std::to_string(laser);
      const double value = parse(item.child_value(), where);
      if (value < 0 || value > 255) complain(where + " is not in 0..255");
      set(lasers[laser++], value);
    }
  }

  void check_count(pugi::xml_node list, std::size_t count) {
    if (!list.child("count")) return;
    const double said = number(list, "count", std::string("<") + list.name() + ">");
    if (error_.empty() && said != static_cast<double>(count)) {
      complain(std::string("<") + list.name() + ">: <count> says " + std::string(trimmed(list.child_value("count"))) +
               " but there are " + std::to_string(count) + " items");
    }
  }

  pugi::xml_node db_;
  std::string_view name_;
  std::string error_;
};

}  // namespace

Expected<Calibration> parse_db_xml(std::string_view text, std::string_view name) {
  pugi::xml_document document;
  const pugi::xml_parse_result result = document.load_buffer(text.data(), text.size());
  if (!result) {
    return fail(std::string(name) + ": not XML (" + result.description() + " at byte " + std::to_string(result.offset) +
                ")" + kXmlRemedy);
  }
  const pugi::xml_node db = document.child("boost_serialization").child("DB");
  if (!db) return fail(std::string(name) + ": element <boost_serialization><DB> is missing" + kXmlRemedy);
  return DbXmlReader(db, name).run();
}

}  // namespace roadvec
