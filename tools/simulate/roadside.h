#pragma once

#include <vector>

#include "tools/simulate/road_edges.h"
#include "tools/simulate/scenery.h"
#include "tools/simulate/world_builder.h"

namespace roadvec {

/// Puts up what stands along a road: walls, fences, rails, hedges, poles, parked cars. Adds their true boundaries.
class Roadside {
 public:
  Roadside(const Ground& ground, int phase, Things& things, std::vector<TruthPiece>& truth)
      : ground_(ground), phase_(phase), things_(things), truth_(truth) {}

  void add_all(const RoadLine& line);

 private:
  using Points = std::vector<Eigen::Vector2d>;
  /// Stations [from_m, to_m].
  struct Stretch {
    double from_m = 0, to_m = 0;
  };
  void add_walls(const RoadLine& line, const WallSpec& wall);
  void add_front(const RoadLine& line, const WallSpec& wall, Stretch stretch, bool side_walls);
  void add_wall(const WallSpec& wall, const Points& points_m);
  void add_hedges(const RoadLine& line, const HedgeSpec& hedge);
  void add_hedge(const HedgeSpec& hedge, const Points& points_m, double left_m);
  void add_poles(const RoadLine& line, const PoleSpec& pole);
  void add_pole(const PoleSpec& pole, const Eigen::Vector2d& centre_m);
  void add_parked_cars(const RoadLine& line, const ParkedCarSpec& cars);
  void add_parked_car(const RoadLine& line, const ParkedCarSpec& cars, double middle_m);
  /// The piece's index, for the thing that shows it.
  std::int32_t add_truth(std::string_view kind, double height_m, const Eigen::Vector2d& a_m, const Eigen::Vector2d& b_m,
                         bool continues);

  [[nodiscard]] std::vector<Stretch> clear_stretches(const RoadLine& line, const RowSpec& row, double setback_m) const;
  [[nodiscard]] double base_m(const Eigen::Vector2d& point_m) const;

  const Ground& ground_;
  int phase_;
  Things& things_;
  std::vector<TruthPiece>& truth_;
};

}  // namespace roadvec
