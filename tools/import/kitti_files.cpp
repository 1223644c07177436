#include "tools/import/kitti_files.h"

#include <array>
#include <bit>
#include <charconv>
#include <chrono>
#include <cmath>
#include <optional>
#include <string>

namespace roadvec {
namespace {

constexpr std::size_t kOxtsNumbers = 30;
constexpr std::size_t kPointBytes = 16;
constexpr float kFarthest_m = 250;  ///< the sensor measures to 120 m, its distance word ends at 131 m

/// Takes the front of a text apart. After the first thing that is not as asked, nothing more is taken.
class TextCursor {
 public:
  explicit TextCursor(std::string_view text) : rest_(text) {}

  void skip_blanks() {
    while (!rest_.empty() &&
           (rest_.front() == ' ' || rest_.front() == '\t' || rest_.front() == '\r' || rest_.front() == '\n')) {
      rest_.remove_prefix(1);
    }
  }
  void literal(std::string_view what) {
    good_ = good_ && rest_.starts_with(what);
    if (good_) rest_.remove_prefix(what.size());
  }
  /// A finite number behind blanks.
  double number() {
    skip_blanks();
    double value = 0;
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    good_ = good_ && error == std::errc{} && std::isfinite(value);
    if (!good_) return 0;
    rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
    return value;
  }
  /// Exactly `count` digits.
  int digits(std::size_t count) {
    int value = 0;
    for (std::size_t i = 0; i < count && good_; ++i) {
      good_ = i < rest_.size() && rest_[i] >= '0' && rest_[i] <= '9';
      if (good_) value = 10 * value + (rest_[i] - '0');
    }
    if (good_) rest_.remove_prefix(count);
    return value;
  }
  /// One to nine digits behind a decimal point, in 1e-9.
  std::int64_t nano() {
    std::int64_t value = 0, unit = 1'000'000'000;
    while (good_ && unit > 1 && !rest_.empty() && rest_.front() >= '0' && rest_.front() <= '9') {
      unit /= 10;
      value += unit * (rest_.front() - '0');
      rest_.remove_prefix(1);
    }
    good_ = good_ && unit < 1'000'000'000;
    return value;
  }
  /// To the line that begins with `key`, behind the key.
  void go_to_line(std::string_view key) {
    while (good_ && !rest_.starts_with(key)) {
      const std::size_t end = rest_.find('\n');
      good_ = end != std::string_view::npos;
      if (good_) rest_.remove_prefix(end + 1);
    }
    literal(key);
  }
  [[nodiscard]] bool good() const { return good_; }
  [[nodiscard]] bool at_end() {
    skip_blanks();
    return good_ && rest_.empty();
  }

 private:
  std::string_view rest_;
  bool good_ = true;
};

template <std::size_t kCount>
std::array<double, kCount> numbers(TextCursor& cursor) {
  std::array<double, kCount> values{};
  for (double& value : values) value = cursor.number();
  return values;
}

}  // namespace

Expected<SensorTime> parse_kitti_time(std::string_view line) {
  namespace c = std::chrono;
  TextCursor cursor(line);
  const int year = cursor.digits(4);
  cursor.literal("-");
  const int month = cursor.digits(2);
  cursor.literal("-");
  const int day = cursor.digits(2);
  cursor.literal(" ");
  const int hour = cursor.digits(2);
  cursor.literal(":");
  const int minute = cursor.digits(2);
  cursor.literal(":");
  const int second = cursor.digits(2);
  cursor.literal(".");
  const std::int64_t fraction_ns = cursor.nano();
  const c::year_month_day date{c::year(year), c::month(static_cast<unsigned>(month)),
                               c::day(static_cast<unsigned>(day))};
  const bool on_the_clock = hour < 24 && minute < 60 && second < 61;
  if (!cursor.at_end() || !date.ok() || year < 1970 || year > 2200 || !on_the_clock) {
    return fail("\"" + std::string(line.substr(0, 40)) + "\" is no time like 2011-09-26 13:04:32.349659964");
  }
  const c::sys_seconds at = c::sys_days(date) + c::hours(hour) + c::minutes(minute) + c::seconds(second);
  return SensorTime{at.time_since_epoch().count() * 1'000'000'000 + fraction_ns};
}

Expected<OxtsSample> parse_oxts(std::string_view line) {
  TextCursor cursor(line);
  const auto v = numbers<kOxtsNumbers>(cursor);
  if (!cursor.at_end()) return fail("not a row of " + std::to_string(kOxtsNumbers) + " numbers");
  OxtsSample sample;
  sample.latitude_deg = v[0];
  sample.longitude_deg = v[1];
  sample.height_m = v[2];
  sample.roll_rad = v[3];
  sample.pitch_rad = v[4];
  sample.yaw_rad = v[5];
  sample.north_mps = v[6];
  sample.east_mps = v[7];
  sample.forward_mps = v[8];
  sample.leftward_mps = -v[9];
  sample.acceleration_mps2 = {v[11], v[12], v[13]};
  sample.rate_radps = {v[17], v[18], v[19]};
  const bool plausible = std::abs(v[0]) <= 90 && std::abs(v[1]) <= 180 && std::abs(v[2]) < 1e5 &&
                         std::abs(v[8]) < 150 && sample.rate_radps.norm() < 50 && std::abs(v[3]) < 7 &&
                         std::abs(v[4]) < 7 && std::abs(v[5]) < 7;
  if (!plausible) return fail("values that no car has");
  return sample;
}

Expected<Eigen::Isometry3d> parse_rigid(std::string_view text) {
  TextCursor cursor(text);
  cursor.go_to_line("R:");
  const auto r = numbers<9>(cursor);
  cursor.skip_blanks();
  cursor.literal("T:");
  const auto t = numbers<3>(cursor);
  if (!cursor.good()) return fail("not a calibration with lines \"R: nine numbers\" and \"T: three numbers\"");
  const Eigen::Matrix3d R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(r.data());
  if (!(R * R.transpose()).isIdentity(1e-3) || R.determinant() < 0) return fail("R is not a rotation");
  Eigen::Isometry3d rigid = Eigen::Isometry3d::Identity();
  rigid.linear() = Eigen::Quaterniond(R).normalized().toRotationMatrix();
  rigid.translation() = Eigen::Vector3d(t[0], t[1], t[2]);
  if (rigid.translation().norm() > 100) return fail("T is longer than a car");
  return rigid;
}

Expected<std::vector<KittiPoint>> parse_scan(std::span<const std::uint8_t> bytes) {
  if (bytes.size() % kPointBytes != 0) {
    return fail(std::to_string(bytes.size()) + " bytes are no whole number of points");
  }
  std::vector<KittiPoint> points;
  points.reserve(bytes.size() / kPointBytes);
  const auto value = [&](std::size_t at) {
    std::uint32_t word = 0;
    for (std::size_t i = 4; i-- > 0;) word = word << 8 | bytes[at + i];
    return std::bit_cast<float>(word);
  };
  for (std::size_t at = 0; at < bytes.size(); at += kPointBytes) {
    const KittiPoint point{value(at), value(at + 4), value(at + 8), value(at + 12)};
    if (point.x_m == 0 && point.y_m == 0) continue;
    // Written so that a value that is no number fails too.
    const bool plausible = std::abs(point.x_m) < kFarthest_m && std::abs(point.y_m) < kFarthest_m &&
                           std::abs(point.z_m) < kFarthest_m && point.reflectance >= 0 && point.reflectance <= 1;
    if (!plausible) return fail("point " + std::to_string(at / kPointBytes) + " is none of an HDL-64E");
    points.push_back(point);
  }
  return points;
}

}  // namespace roadvec
