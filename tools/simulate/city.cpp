#include "tools/simulate/city.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "tools/recording/output_file.h"
#include "tools/simulate/car_motion.h"
#include "tools/simulate/random.h"

namespace roadvec {
namespace {

constexpr double kOverhang_m = 45, kCorner_m = 25;  ///< streets beyond the last crossing; kept free round crossings
constexpr double kTurnRadius_m = 8, kLane_m = -1.75;

/// A crossing by its column and row.
using Crossing = std::array<int, 2>;

class City {
 public:
  City(std::uint64_t seed, double length_km) : random_(seed, 0), length_m_(length_km * 1000) {}

  Expected<std::string> write() {
    lay_streets();
    wander();
    const auto path = RoadPath::create(car_.route, false);
    if (!path) return tl::unexpected(path.error());
    car_.lane_m = kLane_m;
    car_.start_m = 20;
    car_.distance_m = length_m_;
    const auto motion = drive(car_, *path, [](const Eigen::Vector2d&) { return 0.0; });
    if (!motion) return tl::unexpected(motion.error());
    text_ = print(
        "# Made by roadvec-simulate: a random town, %.1f km driven.\n"
        "description = \"random town, %.1f km driven\"\ncorner_radius_m = 6.0\n",
        length_m_ / 1000, length_m_ / 1000);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      for (std::size_t line = 0; line < lines_m_[axis].size(); ++line) write_street(axis, line);
    }
    write_traffic(*motion);
    write_car();
    return text_;
  }

 private:
  double between(double low, double high) { return low + (high - low) * random_.uniform(); }
  bool chance(double share) { return random_.uniform() < share; }
  [[nodiscard]] Eigen::Vector2d place_m(const Crossing& crossing) const {
    return {lines_m_[0][static_cast<std::size_t>(crossing[0])], lines_m_[1][static_cast<std::size_t>(crossing[1])]};
  }

  void lay_streets() {
    const double crossings = length_m_ / 100;
    const auto count = static_cast<std::size_t>(std::max(3.0, std::ceil(0.85 * std::sqrt(crossings)) + 1));
    for (auto& lines_m : lines_m_) {
      for (double at_m = 0; lines_m.size() < count; at_m += between(70, 130)) lines_m.push_back(std::round(at_m));
    }
  }

  /// From crossing to crossing, never straight back, rather to where the drive has not been.
  void wander() {
    const int count = static_cast<int>(lines_m_[0].size());
    Crossing here{0, 0}, before{-1, -1};
    double gone_m = 0;
    while (gone_m < 1.05 * length_m_ + 100) {
      way_.push_back(here);
      Crossing best = here;
      double least = 1e9;
      for (const Crossing& step : {Crossing{1, 0}, Crossing{0, 1}, Crossing{-1, 0}, Crossing{0, -1}}) {
        const Crossing next{here[0] + step[0], here[1] + step[1]};
        if (next == before || std::min(next[0], next[1]) < 0 || std::max(next[0], next[1]) >= count) continue;
        const double cost = used_[{std::min(here, next), std::max(here, next)}] + random_.uniform();
        if (cost < least) {
          least = cost;
          best = next;
        }
      }
      used_[{std::min(here, best), std::max(here, best)}] += 1;
      gone_m += (place_m(best) - place_m(here)).norm();
      before = here;
      here = best;
    }
    way_.push_back(here);
    const Eigen::Vector2d first_m = place_m(way_[0]), second_m = place_m(way_[1]);
    car_.route.push_back({first_m - (second_m - first_m).normalized() * (kOverhang_m - 5), 0});
    for (std::size_t i = 0; i + 1 < way_.size(); ++i) car_.route.push_back({place_m(way_[i]), kTurnRadius_m});
    car_.route.push_back({place_m(way_.back()), 0});
  }

  void write_street(std::size_t axis, std::size_t line) {
    const std::vector<double>& others_m = lines_m_[1 - axis];
    const double at_m = lines_m_[axis][line], from_m = others_m.front() - kOverhang_m,
                 to_m = others_m.back() + kOverhang_m;
    // Things on streets that lie in x have stations that grow with x, on the others with y.
    text_ += axis == 0 ? print("\n[[road]]\nwaypoints = [[%.0f, %.0f], [%.0f, %.0f]]\n", at_m, from_m, at_m, to_m)
                       : print("\n[[road]]\nwaypoints = [[%.0f, %.0f], [%.0f, %.0f]]\n", from_m, at_m, to_m, at_m);
    text_ += print("width_m = %.1f\nkerb_height_m = %.2f\nsidewalk_m = %.1f\nbeyond = \"%s\"\n", between(9.5, 12),
                   between(0.07, 0.15), between(2, 4), chance(0.5) ? "grass" : "sidewalk");
    for (std::size_t i = 0; i + 1 < others_m.size(); ++i) {
      Crossing a, b;
      a[axis] = b[axis] = static_cast<int>(line);
      a[1 - axis] = static_cast<int>(i);
      b[1 - axis] = static_cast<int>(i + 1);
      if (!used_.contains({a, b}) || used_[{a, b}] == 0) continue;
      for (const char* const side : {"left", "right"}) {
        write_roadside(side, others_m[i] - from_m + kCorner_m, others_m[i + 1] - from_m - kCorner_m);
      }
    }
  }

  void row(const char* kind, const char* side, double from_m, double to_m) {
    text_ += print("[[road.%s]]\nside = \"%s\"\nfrom_m = %.1f\nto_m = %.1f\n", kind, side, from_m, to_m);
  }

  /// One side of a street between two crossings.
  void write_roadside(const char* side, double from_m, double to_m) {
    if (chance(0.6)) {
      text_ += print("[[road.driveway]]\nside = \"%s\"\nat_m = %.1f\nwidth_m = %.1f\n", side, between(from_m, to_m),
                     between(3, 5));
    }
    const double look = random_.uniform();
    if (look < 0.6) {
      row("wall", side, from_m - 12, to_m + 12);
      text_ +=
          print("setback_m = %.1f\nheight_m = %.1f\nlength_m = %.1f\nspacing_m = %.1f\ndepth_m = 8\nwindows = true\n",
                between(3, 6), between(5, 9), between(10, 22), between(2, 5));
    } else if (look < 0.75) {
      row("wall", side, from_m - 12, to_m + 12);
      text_ += print("setback_m = %.1f\nheight_m = %.1f\n", between(2.5, 4), between(0.8, 2.2));
    } else if (look < 0.9) {
      row("hedge", side, from_m - 12, to_m + 12);
      text_ += print("setback_m = %.1f\nheight_m = %.1f\n", between(2.5, 4), between(0.9, 2));
    } else {
      row("fence", side, from_m - 12, to_m + 12);
      text_ += print("setback_m = %.1f\n", between(2.5, 4));
    }
    row("pole", side, from_m + between(0, 8), to_m);
    const bool trees = chance(0.5);
    text_ += trees ? print("every_m = %.1f\nradius_m = 0.16\nmaterial = \"tree\"\n", between(9, 15))
                   : print("every_m = 24\n");
    if (chance(0.6)) {
      row("parked_cars", side, from_m, to_m);
      text_ += print("missing = %.2f\n", between(0.1, 0.6));
    }
  }

  /// On every straight stretch of the drive somebody comes the other way about its middle, and people walk.
  void write_traffic(const CarMotion& motion) {
    double time_s = 0;
    for (std::size_t first = 0; first + 1 < way_.size();) {
      std::size_t last = first + 1;
      const Crossing step{way_[first + 1][0] - way_[first][0], way_[first + 1][1] - way_[first][1]};
      while (last + 1 < way_.size() && way_[last + 1][0] - way_[last][0] == step[0] &&
             way_[last + 1][1] - way_[last][1] == step[1])
        ++last;
      const Eigen::Vector2d a_m = place_m(way_[first]), b_m = place_m(way_[last]), ahead = (b_m - a_m).normalized();
      const Eigen::Vector2d middle_m = (a_m + b_m) / 2;
      while (time_s < motion.duration_s() && (motion.at(time_s).pose.translation() - middle_m).norm() > 4)
        time_s += 0.2;
      if (time_s >= motion.duration_s()) return;
      const Eigen::Vector2d start_m = b_m + ahead * 40, end_m = a_m - ahead * 40;
      const bool cyclist = chance(0.25);
      mover(cyclist ? "cyclist" : "car", start_m, end_m, kLane_m, cyclist ? between(3, 5) : between(6, 11),
            (start_m - middle_m).norm(), time_s);
      if (chance(0.7)) mover("pedestrian", a_m, b_m, chance(0.5) ? 7 : -7, between(0.8, 1.6), between(10, 40), time_s);
      first = last;
    }
  }

  /// It has gone `gone_m` at that time.
  void mover(const char* kind, const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m, double lane_m,
             double speed_mps, double gone_m, double time_s) {
    const double start_s = time_s - gone_m / speed_mps;
    text_ += print(
        "\n[[mover]]\nkind = \"%s\"\nwaypoints = [[%.0f, %.0f], [%.0f, %.0f]]\nlane_m = %.2f\nspeed_mps = %.1f\n"
        "start_s = %.1f\nfrom_m = %.1f\n",
        kind, from_m.x(), from_m.y(), to_m.x(), to_m.y(), lane_m, speed_mps, std::max(0.0, start_s),
        std::max(0.0, -start_s * speed_mps));
  }

  void write_car() {
    text_ += "\n[car]\nroute = [";
    for (std::size_t i = 0; i < car_.route.size(); ++i) {
      const Waypoint& point = car_.route[i];
      text_ += print("%s[%.1f, %.1f, %.0f]",
                     i == 0       ? ""
                     : i % 6 == 0 ? ",\n  "
                                  : ", ",
                     point.position_m.x(), point.position_m.y(), point.radius_m);
    }
    text_ += print("]\nstart_m = %.1f\ndistance_m = %.1f\nlane_m = %.2f\n", car_.start_m, car_.distance_m, car_.lane_m);
  }

  Random random_;
  double length_m_;
  std::array<std::vector<double>, 2> lines_m_;  ///< x of the streets along y, y of those along x
  std::vector<Crossing> way_;
  std::map<std::array<Crossing, 2>, double> used_;  ///< how often the drive uses the street between two crossings
  CarSpec car_;
  std::string text_;
};

}  // namespace

Expected<std::string> city_scene(std::uint64_t seed, double length_km) { return City(seed, length_km).write(); }

}  // namespace roadvec
