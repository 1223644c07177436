#include "drivers/velodyne/nmea.h"

#include <array>
#include <charconv>
#include <cmath>

namespace roadvec {
namespace {

constexpr double kMpsPerKnot = 1852.0 / 3600.0;
constexpr std::int64_t kSecond_ns = 1'000'000'000, kDay_s = 86'400;
constexpr std::size_t kMostFields = 24;

struct Fields {
  std::array<std::string_view, kMostFields> texts{};
  std::size_t count = 0;
  [[nodiscard]] std::string_view operator[](std::size_t i) const { return i < count ? texts[i] : std::string_view{}; }
};

Fields split(std::string_view body) {
  Fields fields;
  while (fields.count < kMostFields) {
    const std::size_t comma = body.find(',');
    fields.texts[fields.count++] = body.substr(0, comma);
    if (comma == std::string_view::npos) break;
    body.remove_prefix(comma + 1);
  }
  return fields;
}

std::optional<double> number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<int> two_digits(std::string_view text, std::size_t at) {
  if (at + 2 > text.size()) return std::nullopt;
  const char tens = text[at], ones = text[at + 1];
  if (tens < '0' || tens > '9' || ones < '0' || ones > '9') return std::nullopt;
  return (tens - '0') * 10 + (ones - '0');
}

/// hhmmss or hhmmss.fff
std::optional<std::int64_t> time_of_day_ns(std::string_view text) {
  const auto hour = two_digits(text, 0), minute = two_digits(text, 2), second = two_digits(text, 4);
  if (!hour || !minute || !second || *hour > 23 || *minute > 59 || *second > 60) return std::nullopt;
  std::int64_t fraction_ns = 0;
  if (text.size() > 6) {
    if (text[6] != '.') return std::nullopt;
    std::int64_t digit_ns = kSecond_ns / 10;
    for (const char c : text.substr(7)) {
      if (c < '0' || c > '9') return std::nullopt;
      fraction_ns += (c - '0') * digit_ns;
      digit_ns /= 10;
    }
  }
  return ((*hour * 60 + *minute) * 60 + *second) * kSecond_ns + fraction_ns;
}

/// ddmmyy, as days since 1970; years 80 to 99 are those of the last century.
std::optional<std::int64_t> day_of(std::string_view text) {
  const auto day = two_digits(text, 0), month = two_digits(text, 2), short_year = two_digits(text, 4);
  if (text.size() != 6 || !day || !month || !short_year || *day < 1 || *day > 31 || *month < 1 || *month > 12)
    return std::nullopt;
  // Years that begin in March put the leap day last; 153 days make five months of 31, 30, 31, 30, 31.
  const int year = *short_year + (*short_year < 80 ? 2000 : 1900) - (*month <= 2 ? 1 : 0);
  const int day_of_year = (153 * ((*month + 9) % 12) + 2) / 5 + *day - 1;
  constexpr std::int64_t kDaysToMarchOfYear0 = 719'468;
  return 365LL * year + year / 4 - year / 100 + year / 400 + day_of_year - kDaysToMarchOfYear0;
}

/// dddmm.mmmm and a hemisphere.
std::optional<double> angle_deg(std::string_view text, std::string_view hemisphere, char negative, char positive) {
  const std::optional<double> value = number(text);
  if (!value || *value < 0 || hemisphere.size() != 1) return std::nullopt;
  const double whole_deg = std::floor(*value / 100);
  const double deg = whole_deg + (*value - whole_deg * 100) / 60;
  if (hemisphere[0] == positive) return deg;
  if (hemisphere[0] == negative) return -deg;
  return std::nullopt;
}

std::optional<NmeaFix::Place> place(const Fields& fields, std::size_t first) {
  const auto latitude_deg = angle_deg(fields[first], fields[first + 1], 'S', 'N');
  const auto longitude_deg = angle_deg(fields[first + 2], fields[first + 3], 'W', 'E');
  if (!latitude_deg || !longitude_deg || std::abs(*latitude_deg) > 90 || std::abs(*longitude_deg) > 180)
    return std::nullopt;
  return NmeaFix::Place{*latitude_deg, *longitude_deg};
}

bool read_rmc(const Fields& fields, NmeaFix& fix) {
  if (fields.count < 10 || (fields[2] != "A" && fields[2] != "V")) return false;
  fix.valid = fields[2] == "A";
  fix.time_of_day_ns = time_of_day_ns(fields[1]);
  const std::optional<std::int64_t> day = day_of(fields[9]);
  if (day && fix.time_of_day_ns) fix.utc = SensorTime{*day * kDay_s * kSecond_ns + *fix.time_of_day_ns};
  fix.place = place(fields, 3);
  if (const auto knots = number(fields[7])) fix.speed_mps = *knots * kMpsPerKnot;
  fix.course_deg = number(fields[8]);
  return !fix.valid || (fix.utc && fix.place);
}

bool read_gga(const Fields& fields, NmeaFix& fix) {
  const std::optional<double> quality = number(fields[6]);
  if (fields.count < 12 || !quality) return false;
  fix.valid = *quality > 0;
  fix.time_of_day_ns = time_of_day_ns(fields[1]);
  fix.place = place(fields, 2);
  // Height above the geoid and the geoid's above the ellipsoid.
  const auto above_geoid_m = number(fields[9]), geoid_m = number(fields[11]);
  if (above_geoid_m) fix.height_m = *above_geoid_m + geoid_m.value_or(0);
  return !fix.valid || (fix.time_of_day_ns && fix.place);
}

}  // namespace

NmeaResult parse_nmea(std::string_view sentence, NmeaFix& fix) noexcept {
  fix = {};
  // By the star and not from the end: some receivers end without CR LF.
  const std::size_t star = sentence.find('*');
  if (sentence.empty() || sentence.front() != '$' || star == std::string_view::npos) return NmeaResult::malformed;
  const std::string_view body = sentence.substr(1, star - 1);
  unsigned sum = 0;
  for (const char c : body) sum ^= static_cast<unsigned char>(c);
  const std::string_view digits = sentence.substr(star + 1, 2);
  unsigned told = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), told, 16);
  if (error != std::errc{} || end != digits.data() + 2 || told != sum) return NmeaResult::bad_checksum;
  const Fields fields = split(body);
  // "GPRMC", "GNGGA", ...: the first two letters say which satellites.
  if (fields[0].size() != 5) return NmeaResult::other_sentence;
  const std::string_view kind = fields[0].substr(2);
  if (kind != "RMC" && kind != "GGA") return NmeaResult::other_sentence;
  const bool read = kind == "RMC" ? read_rmc(fields, fix) : read_gga(fields, fix);
  if (!read) fix = {};
  return read ? NmeaResult::fix : NmeaResult::malformed;
}

}  // namespace roadvec
