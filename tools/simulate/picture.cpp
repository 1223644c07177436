#include "tools/simulate/picture.h"

#include <algorithm>
#include <cmath>

#include "tools/recording/output_file.h"
#include "tools/simulate/car_motion.h"
#include "tools/simulate/world_builder.h"

namespace roadvec {
namespace {

using Points = std::vector<Eigen::Vector2d>;

constexpr double kMargin_m = 8, kUnits_1pm = 10, kTolerance_m = 0.12;

/// Without the points that lie within kTolerance_m of the line through their neighbours that stay.
Points thinned(const Points& points_m) {
  Points kept_m;
  for (std::size_t first = 0; first < points_m.size();) {
    kept_m.push_back(points_m[first]);
    std::size_t last = first + 1;
    const auto fits = [&](std::size_t end) {
      const Eigen::Vector2d leg = (points_m[end] - points_m[first]).normalized();
      return std::all_of(points_m.begin() + static_cast<std::ptrdiff_t>(first),
                         points_m.begin() + static_cast<std::ptrdiff_t>(end), [&](const Eigen::Vector2d& point_m) {
                           const Eigen::Vector2d offset = point_m - points_m[first];
                           return std::abs(leg.x() * offset.y() - leg.y() * offset.x()) < kTolerance_m;
                         });
    };
    while (last + 1 < points_m.size() && fits(last + 1)) ++last;
    first = last;
  }
  return kept_m;
}

class Picture {
 public:
  Picture(const Eigen::Vector2d& low_m, const Eigen::Vector2d& high_m) : low_m_(low_m), high_m_(high_m) {
    const Eigen::Vector2d size = (high_m - low_m) * kUnits_1pm;
    text_ = print(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.0f %.0f\" fill=\"none\" "
        "stroke-linecap=\"round\" stroke-linejoin=\"round\">\n<rect width=\"100%%\" height=\"100%%\" "
        "fill=\"#eef3e6\"/>\n",
        size.x(), size.y());
  }
  /// Paths that follow share these attributes.
  void begin(const std::string& attributes) { text_ += "<path " + attributes + " d=\""; }
  void line(const Points& points_m, bool closed) {
    Eigen::Vector2i before(0, 0);
    bool first = true;
    for (const Eigen::Vector2d& point_m : thinned(points_m)) {
      const Eigen::Vector2i at = units(point_m);
      text_ += print("%c%d %d", first ? 'M' : 'l', at.x() - before.x(), at.y() - before.y());
      before = at;
      first = false;
    }
    if (closed) text_ += 'z';
  }
  void end() { text_ += "\"/>\n"; }
  std::string finish() { return text_ + "</svg>\n"; }

 private:
  [[nodiscard]] Eigen::Vector2i units(const Eigen::Vector2d& point_m) const {
    return {static_cast<int>(std::lround((point_m.x() - low_m_.x()) * kUnits_1pm)),
            static_cast<int>(std::lround((high_m_.y() - point_m.y()) * kUnits_1pm))};
  }
  Eigen::Vector2d low_m_, high_m_;
  std::string text_;
};

Points corners(const Eigen::Vector2d& centre_m, const Eigen::Vector2d& axis, double half_length_m,
               double half_width_m) {
  const Eigen::Vector2d x = axis * half_length_m, y = Eigen::Vector2d(-axis.y(), axis.x()) * half_width_m;
  return {centre_m - x - y, centre_m + x - y, centre_m + x + y, centre_m - x + y};
}

/// Pieces one after the other as lines, those that `wanted` names.
template <class Piece, class Wanted, class Continues>
void draw_pieces(Picture& picture, const std::string& attributes, const std::vector<Piece>& pieces, Wanted&& wanted,
                 Continues&& continues) {
  picture.begin(attributes);
  Points line_m;
  const auto flush = [&] {
    if (!line_m.empty()) picture.line(line_m, false);
    line_m.clear();
  };
  for (const Piece& piece : pieces) {
    if (!wanted(piece)) {
      flush();
      continue;
    }
    if (!continues(piece) || line_m.empty() || (line_m.back() - piece.a_m).norm() > 1e-6) flush();
    if (line_m.empty()) line_m.push_back(piece.a_m);
    line_m.push_back(piece.b_m);
  }
  flush();
  picture.end();
}

void draw_roads(Picture& picture, const std::vector<Kerb>& kerbs) {
  picture.begin("fill=\"#cfd2d6\" fill-rule=\"evenodd\"");
  Points outline_m;
  for (std::size_t i = 0; i < kerbs.size(); ++i) {
    outline_m.push_back(kerbs[i].a_m);
    if (i + 1 < kerbs.size() && (kerbs[i].b_m - kerbs[i + 1].a_m).norm() < 1e-6) continue;
    picture.line(outline_m, true);
    outline_m.clear();
  }
  picture.end();
}

void draw_truth(Picture& picture, const std::vector<TruthPiece>& truth, int phase) {
  const struct {
    std::string_view kind;
    const char* attributes;
  } styles[] = {{"unknown", "stroke=\"#7a9a4a\" stroke-width=\"3\" stroke-dasharray=\"6 6\""},
                {"curb", "stroke=\"#555\" stroke-width=\"3\""},
                {"barrier", "stroke=\"#8a4b2a\" stroke-width=\"5\""},
                {"vegetation", "stroke=\"#2f7d32\" stroke-width=\"8\""}};
  for (const auto& style : styles) {
    draw_pieces(
        picture, style.attributes, truth,
        [&](const TruthPiece& piece) { return piece.kind == style.kind && piece.phase == phase; },
        [](const TruthPiece& piece) { return piece.continues; });
  }
  draw_pieces(
      picture, "stroke=\"#d33\" stroke-width=\"4\" stroke-dasharray=\"8 8\"", truth,
      [](const TruthPiece& piece) { return piece.gone; }, [](const TruthPiece& piece) { return piece.continues; });
}

void draw_things(Picture& picture, const Things& things, const std::vector<Movers::Outline>& movers) {
  picture.begin("fill=\"#8fa3c7\"");
  for (const Box& box : things.boxes) {
    // Each parked car's body, the one box of it that truth knows.
    if (box.side == Material::car && box.faces[0] != Hit::kOther)
      picture.line(corners(box.centre_m, box.axis, box.half_length_m, box.half_width_m), true);
  }
  picture.end();
  picture.begin("fill=\"#444\"");
  for (const Pole& pole : things.poles) {
    const double half_m = std::max(pole.radius_m, 0.25);
    picture.line(corners(pole.centre_m, {1, 0}, half_m, half_m), true);
  }
  picture.end();
  picture.begin("fill=\"#e08a00\"");
  for (const Movers::Outline& mover : movers) {
    picture.line(
        corners(mover.centre_m, mover.ahead, std::max(mover.half_length_m, 0.5), std::max(mover.half_width_m, 0.4)),
        true);
  }
  picture.end();
}

}  // namespace

Expected<std::string> picture_of(const Scene& scene) {
  const auto path = route_of(scene);
  if (!path) return tl::unexpected(path.error());
  const auto built = build_world(scene);
  if (!built) return tl::unexpected(built.error());
  const auto motion =
      drive(scene.car, *path, [&](const Eigen::Vector2d& point_m) { return built->world.height_at(point_m); });
  if (!motion) return tl::unexpected(motion.error());
  Points way_m;
  for (double time_s = 0; time_s < motion->duration_s(); time_s += 0.1)
    way_m.push_back(motion->at(time_s).pose.translation());
  Eigen::Vector2d low_m = way_m.front(), high_m = low_m;
  for (const TruthPiece& piece : built->truth) {
    low_m = low_m.cwiseMin(piece.a_m);
    high_m = high_m.cwiseMax(piece.a_m);
  }
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(kMargin_m);
  const Scenery& scenery = built->world.scenery(motion->duration_s());
  Picture picture(low_m - margin, high_m + margin);
  draw_roads(picture, scenery.things().kerbs);
  draw_truth(picture, built->truth, scene.maybe_change_s ? 1 : 0);
  draw_things(picture, scenery.things(), built->world.movers().at(motion->duration_s() / 2));
  picture.begin("stroke=\"#c00\" stroke-width=\"4\" opacity=\"0.7\"");
  picture.line(way_m, false);
  picture.end();
  return picture.finish();
}

}  // namespace roadvec
