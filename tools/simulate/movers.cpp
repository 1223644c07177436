#include "tools/simulate/movers.h"

#include <algorithm>
#include <cmath>

namespace roadvec {
namespace {

Box box_at(const Eigen::Vector2d& centre_m, double length_m, double width_m, double bottom_m, double top_m,
           Material side, Material roof) {
  Box box;
  box.centre_m = centre_m;
  box.half_length_m = length_m / 2;
  box.half_width_m = width_m / 2;
  box.bottom_m = bottom_m;
  box.top_m = top_m;
  box.side = side;
  box.roof = roof;
  return box;
}

Eigen::Vector2d turned(const Eigen::Vector2d& point, const Eigen::Vector2d& ahead) {
  return {ahead.x() * point.x() - ahead.y() * point.y(), ahead.y() * point.x() + ahead.x() * point.y()};
}

std::vector<Box> boxes_of(MoverKind kind) {
  const auto person = [](double low_m, double high_m, double depth_m, double width_m) {
    return box_at({0, 0}, depth_m, width_m, low_m, high_m, Material::person, Material::person);
  };
  switch (kind) {
    case MoverKind::car:
      return car_boxes({0, 0}, {1, 0}, 4.4, 1.8, 1.45);
    case MoverKind::cyclist:
      return {box_at({0, 0}, 1.75, 0.08, 0.1, 0.75, Material::metal, Material::metal), person(0.75, 1.75, 0.4, 0.5)};
    case MoverKind::pedestrian:
      return {person(0, 0.85, 0.25, 0.35), person(0.85, 1.75, 0.3, 0.5)};
  }
  return {};
}

}  // namespace

std::vector<Box> car_boxes(const Eigen::Vector2d& centre_m, const Eigen::Vector2d& ahead, double length_m,
                           double width_m, double height_m) {
  constexpr double kClearance_m = 0.25, kWheel_m = 0.62, kTyre_m = 0.2, kCabin = 0.55, kRoof_m = 0.04;
  const double bonnet_m = 0.58 * height_m, back_m = -0.06 * length_m;
  std::vector<Box> boxes{box_at({0, 0}, length_m, width_m, kClearance_m, bonnet_m, Material::car, Material::car),
                         box_at({back_m, 0}, kCabin * length_m, 0.84 * width_m, bonnet_m, height_m - kRoof_m,
                                Material::glass, Material::glass),
                         box_at({back_m, 0}, kCabin * length_m, 0.84 * width_m, height_m - kRoof_m, height_m,
                                Material::car, Material::car)};
  for (const double x : {-0.3, 0.3}) {
    for (const double y : {-1.0, 1.0}) {
      boxes.push_back(box_at({x * length_m, y * (width_m - kTyre_m) / 2}, kWheel_m, kTyre_m, 0,
                             kWheel_m / 2 + kClearance_m / 2, Material::car, Material::car));
    }
  }
  for (Box& box : boxes) {
    box.centre_m = centre_m + turned(box.centre_m, ahead);
    box.axis = ahead;
  }
  return boxes;
}

Expected<Movers> Movers::create(const std::vector<MoverSpec>& specs, const Scenery& scenery) {
  Movers movers;
  for (const MoverSpec& spec : specs) {
    const auto path = RoadPath::create(spec.path, spec.closed);
    if (!path) return fail("mover " + std::to_string(movers.movers_.size() + 1) + ": " + path.error().message);
    Mover mover{spec, path->length_m(), {}, boxes_of(spec.kind), 0};
    const auto count = static_cast<std::size_t>(std::ceil(mover.length_m / kStep_m)) + 1;
    for (std::size_t i = 0; i < count; ++i) {
      const double station_m = std::min(static_cast<double>(i) * kStep_m, mover.length_m);
      const double heading_rad = path->at(station_m).heading_rad;
      const Eigen::Vector2d centre_m = path->beside(station_m, spec.lane_m);
      const Sheet sheet = scenery.on_road(centre_m) ? Sheet::road : Sheet::beside;
      const Ground::Level ground = scenery.ground().level(sheet, centre_m);
      mover.places.push_back(
          {centre_m, {std::cos(heading_rad), std::sin(heading_rad)}, ground.gradient, ground.height_m});
    }
    for (const Box& box : mover.boxes) {
      mover.reach_m = std::max(mover.reach_m, box.centre_m.norm() + std::hypot(box.half_length_m, box.half_width_m));
    }
    movers.movers_.push_back(std::move(mover));
  }
  movers.list_by_second();
  return movers;
}

void Movers::list_by_second() {
  const auto first_s = [](const Mover& mover) { return static_cast<std::size_t>(mover.spec.start_s); };
  const auto end_s = [](const Mover& mover) {
    return mover.spec.closed ? mover.spec.start_s
                             : mover.spec.start_s + (mover.length_m - mover.spec.from_m) / mover.spec.speed_mps;
  };
  std::size_t count = 1;
  for (const Mover& mover : movers_) count = std::max(count, static_cast<std::size_t>(std::max(0.0, end_s(mover))) + 2);
  by_second_.resize(count);
  for (std::uint32_t i = 0; i < movers_.size(); ++i) {
    const auto last_s = movers_[i].spec.closed ? count - 1 : static_cast<std::size_t>(std::max(0.0, end_s(movers_[i])));
    for (std::size_t second = first_s(movers_[i]); second <= last_s; ++second) by_second_[second].push_back(i);
  }
}

bool Movers::place_at(const Mover& mover, double time_s, Place& place) {
  if (time_s < mover.spec.start_s) return false;
  double station_m = mover.spec.from_m + mover.spec.speed_mps * (time_s - mover.spec.start_s);
  if (mover.spec.closed) station_m -= mover.length_m * std::floor(station_m / mover.length_m);
  if (station_m > mover.length_m) return false;
  const double at = station_m / kStep_m;
  const auto i = std::min(static_cast<std::size_t>(at), mover.places.size() - 2);
  const double share = at - static_cast<double>(i);
  const Place &a = mover.places[i], &b = mover.places[i + 1];
  place = {a.centre_m + share * (b.centre_m - a.centre_m), a.ahead, a.gradient,
           std::lerp(a.height_m, b.height_m, share)};
  return true;
}

void Movers::find(double time_s, const Eigen::Vector2d& eye_m, double reach_m, std::vector<Placed>& placed) const {
  placed.clear();
  const auto second = std::min(static_cast<std::size_t>(std::max(0.0, time_s)), by_second_.size() - 1);
  for (const std::uint32_t i : by_second_[second]) {
    Placed one{i, {}};
    if (!place_at(movers_[i], time_s, one.place)) continue;
    const double near_m = reach_m + movers_[i].reach_m;
    if ((one.place.centre_m - eye_m).squaredNorm() < near_m * near_m) placed.push_back(one);
  }
}

void Movers::cast(std::span<const Placed> placed, std::span<const Beam> beams, double from_m,
                  std::span<Hit> hits) const {
  const Eigen::Vector2d step = beams.front().direction.head<2>(), eye_m = beams.front().origin_m.head<2>();
  for (const Placed& one : placed) {
    const Mover& mover = movers_[one.mover];
    const Place& place = one.place;
    const Eigen::Vector2d offset = place.centre_m - eye_m;
    const double aside_m = cross(step, offset), near_m = mover.reach_m + Scenery::kStray_m;
    if (step.dot(offset) < -near_m || aside_m * aside_m > near_m * near_m * step.squaredNorm()) continue;
    for (Box box : mover.boxes) {
      box.centre_m = place.centre_m + turned(box.centre_m, place.ahead);
      box.axis = place.ahead;
      box.base_m = place.height_m + place.gradient.dot(box.centre_m - place.centre_m);
      box.gradient = place.gradient;
      for (std::size_t k = 0; k < beams.size(); ++k) meet(box, beams[k], from_m, hits[k].range_m, hits[k]);
    }
  }
}

std::vector<Movers::Outline> Movers::at(double time_s) const {
  std::vector<Outline> outlines;
  for (const Mover& mover : movers_) {
    Place place;
    if (!place_at(mover, time_s, place)) continue;
    const Box& body = mover.boxes.front();
    outlines.push_back({place.centre_m, place.ahead, body.half_length_m, body.half_width_m});
  }
  return outlines;
}

}  // namespace roadvec
