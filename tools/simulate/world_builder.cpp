#include "tools/simulate/world_builder.h"

#include <algorithm>

#include "tools/simulate/roadside.h"

namespace roadvec {
namespace {

/// Kerbs as beams meet them, and the truth of each: the line where the face meets the road.
void add_kerbs(const std::vector<RoadEdge>& edges, const Ground& ground, int phase, Things& things,
               std::vector<TruthPiece>& truth) {
  constexpr double kNoKerb_m = 0.005;
  bool broken = true;
  for (const RoadEdge& edge : edges) {
    const auto level_m = [&](Sheet sheet, const Eigen::Vector2d& at_m) {
      return ground.height_m(sheet, at_m.x(), at_m.y());
    };
    Kerb kerb{edge.a_m,
              edge.b_m,
              level_m(Sheet::road, edge.a_m),
              level_m(Sheet::road, edge.b_m),
              level_m(Sheet::beside, edge.a_m),
              level_m(Sheet::beside, edge.b_m),
              edge.round_m};
    if (!edge.open) {
      const double height_m = (edge.kerb_a_m + edge.kerb_b_m) / 2;
      const bool kerbless = height_m < kNoKerb_m;
      kerb.face = static_cast<std::int32_t>(truth.size());
      truth.push_back({kerbless ? "unknown" : "curb", kerbless ? 0 : height_m, edge.a_m, edge.b_m,
                       edge.continues && !broken, phase});
    }
    broken = edge.open;
    things.kerbs.push_back(kerb);
  }
}

Expected<Scenery> build_scenery(const Scene& scene, int phase, std::vector<TruthPiece>& truth) {
  const auto lines = road_lines(scene, phase);
  if (!lines) return tl::unexpected(lines.error());
  const std::vector<RoadEdge> edges = road_edges(scene, *lines, phase);
  if (edges.empty()) return fail("road: there must be one");
  // Far from roads the land is like that behind the first road's sidewalk.
  constexpr double kRises_m = Ground::kReach_m / 2;
  const RoadSpec& first = scene.roads.front();
  Ground ground(Land(scene), edges, first.kerb_height_m + first.sidewalk_percent / 100 * kRises_m,
                first.sidewalk_m > Ground::kReach_m ? Material::sidewalk : first.beyond);
  Things things;
  add_kerbs(edges, ground, phase, things, truth);
  Roadside roadside(ground, phase, things, truth);
  for (const RoadLine& line : *lines) roadside.add_all(line);
  return Scenery::build(std::move(ground), std::move(things), scene.roughness_m);
}

/// True if the middle of `piece` lies on `other`.
bool lies_on(const TruthPiece& piece, const TruthPiece& other) {
  constexpr double kSame_m = 0.03;
  const Eigen::Vector2d leg = other.b_m - other.a_m, offset = (piece.a_m + piece.b_m) / 2 - other.a_m;
  const double share = std::clamp(offset.dot(leg) / leg.squaredNorm(), 0.0, 1.0);
  return piece.kind == other.kind && (offset - share * leg).norm() < kSame_m;
}

/// Finds what the scene's change took away and what it left as it was.
void compare_phases(std::vector<TruthPiece>& truth) {
  const auto after = std::find_if(truth.begin(), truth.end(), [](const TruthPiece& piece) { return piece.phase == 1; });
  for (auto piece = after; piece != truth.end(); ++piece) {
    const auto earlier =
        std::find_if(truth.begin(), after, [&](const TruthPiece& other) { return lies_on(*piece, other); });
    if (earlier != after) piece->earlier = static_cast<std::int32_t>(earlier - truth.begin());
  }
  for (auto piece = truth.begin(); piece != after; ++piece) {
    piece->gone = std::none_of(after, truth.end(), [&](const TruthPiece& other) { return lies_on(*piece, other); });
  }
}

}  // namespace

Expected<RoadPath> route_of(const Scene& scene) {
  const bool own = !scene.car.route.empty();
  if (!own && scene.roads.empty()) return fail("road: there must be one");
  auto path = own ? RoadPath::create(scene.car.route, scene.car.route_closed)
                  : RoadPath::create(scene.roads.front().waypoints, scene.roads.front().closed);
  if (!path) return fail((own ? "car.route: " : "road 1: ") + path.error().message);
  return path;
}

Expected<BuiltWorld> build_world(const Scene& scene) {
  std::vector<TruthPiece> truth;
  std::vector<Scenery> sceneries;
  for (int phase = 0; phase < (scene.maybe_change_s ? 2 : 1); ++phase) {
    auto scenery = build_scenery(scene, phase, truth);
    if (!scenery) return tl::unexpected(scenery.error());
    sceneries.push_back(std::move(*scenery));
  }
  if (scene.maybe_change_s) compare_phases(truth);
  auto movers = Movers::create(scene.movers, sceneries.front());
  if (!movers) return tl::unexpected(movers.error());
  return BuiltWorld{World(std::move(sceneries), scene.maybe_change_s.value_or(0), std::move(*movers), truth.size()),
                    std::move(truth)};
}

}  // namespace roadvec
