#include <algorithm>
#include <cstdarg>
#include <cstdio>

#include "tools/score/score.h"

namespace roadvec {
namespace {

constexpr double kMargin_m = 5, kWidth_px = 1200;

class Picture {
 public:
  Picture(const Eigen::Vector2d& low_m, const Eigen::Vector2d& high_m)
      : low_m_(low_m), high_m_(high_m), scale_(kWidth_px / (high_m.x() - low_m.x())) {
    add("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%.0f\" height=\"%.0f\" fill=\"none\" "
        "stroke-linecap=\"round\">\n"
        "<rect width=\"100%%\" height=\"100%%\" fill=\"white\"/>\n",
        kWidth_px, scale_ * (high_m.y() - low_m.y()));
  }
  void begin(const char* colour, double width_px) {
    add("<path stroke=\"%s\" stroke-width=\"%.1f\" d=\"", colour, width_px);
  }
  void point(char command, const Eigen::Vector2d& p_m) {
    add("%c%.1f %.1f", command, scale_ * (p_m.x() - low_m_.x()), scale_ * (high_m_.y() - p_m.y()));
  }
  void end() { text_ += "\"/>\n"; }
  void label(int row, const char* colour, const char* what) {
    add("<text x=\"12\" y=\"%d\" fill=\"%s\" font-family=\"sans-serif\" font-size=\"14\">%s</text>\n", 20 * row, colour,
        what);
  }
  std::string finish() { return text_ + "</svg>\n"; }

 private:
  [[gnu::format(printf, 2, 3)]] void add(const char* format, ...) {
    char buffer[256];
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(buffer, sizeof buffer, format, arguments);
    va_end(arguments);
    text_ += buffer;
  }
  Eigen::Vector2d low_m_, high_m_;
  double scale_;
  std::string text_;
};

/// The samples that are wanted, each as the short piece of line that it stands for.
template <class Wanted>
void draw_samples(Picture& picture, const std::vector<LineSample>& samples, const char* colour, double width_px,
                  Wanted&& wanted) {
  picture.begin(colour, width_px);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!wanted(i)) continue;
    const bool goes_on = i > 0 && wanted(i - 1) && samples[i - 1].line == samples[i].line;
    if (!goes_on) picture.point('M', samples[i].position_m);
    picture.point('L', samples[i].position_m);
  }
  picture.end();
}

void draw_way(Picture& picture, const Trajectory& way, const char* colour) {
  picture.begin(colour, 1.0);
  for (std::size_t i = 0; i < way.size(); ++i) picture.point(i == 0 ? 'M' : 'L', way[i].T_map_vehicle.translation());
  picture.end();
}

}  // namespace

std::string picture_of(const Score& score) {
  Eigen::Vector2d low_m(-10, -10), high_m(10, 10);
  const auto grow = [&](const Eigen::Vector2d& p_m) {
    low_m = low_m.cwiseMin(p_m);
    high_m = high_m.cwiseMax(p_m);
  };
  for (const Vertex& vertex : score.map.lines.vertices()) grow(vertex.position());
  for (const Vertex& vertex : score.truth.lines.vertices()) grow(vertex.position());
  for (const StampedPose& pose : score.true_way) grow(pose.T_map_vehicle.translation());
  Picture picture(low_m - Eigen::Vector2d(kMargin_m, kMargin_m), high_m + Eigen::Vector2d(kMargin_m, kMargin_m));

  const auto is_visible = [&](std::size_t i) { return score.visible_truth[i]; };
  draw_samples(picture, score.truth_samples, "#e8e8e8", 5, [&](std::size_t i) { return !is_visible(i); });
  draw_samples(picture, score.truth_samples, "#b8c4d6", 5, is_visible);
  const std::vector<LineSample> optional_samples = sample(score.truth.optional_lines, kSampleSpacing_m);
  draw_samples(picture, optional_samples, "#f2e6c9", 5, [](std::size_t) { return true; });
  const std::vector<LineSample> map_samples = samples_that_count(score.map.lines, score.truth);
  const auto errors = distances_m(map_samples, score.truth.lines, kTolerances_m.back());
  const auto within = [&](double least_m, double most_m) {
    return [&errors, least_m, most_m](std::size_t i) {
      const double error_m = errors[i].value_or(kTolerances_m.back());
      return error_m >= least_m && error_m < most_m;
    };
  };
  draw_samples(picture, map_samples, "#1a7f37", 1.6, within(0, 0.1));
  draw_samples(picture, map_samples, "#d98e04", 1.6, within(0.1, 0.3));
  draw_samples(picture, map_samples, "#c1121f", 1.6, within(0.3, 1e9));
  draw_way(picture, score.true_way, "#888888");
  draw_way(picture, score.ours, "#3a5fcd");
  picture.label(1, "#6b7f9e", "truth that was visible; paler: that was not");
  picture.label(2, "#b09a5b", "truth that a map may have or lack");
  picture.label(3, "#1a7f37", "map within 0.1 m of the truth");
  picture.label(4, "#d98e04", "within 0.3 m");
  picture.label(5, "#c1121f", "farther");
  picture.label(6, "#3a5fcd", "way driven, by us; grey: truly");
  return picture.finish();
}

}  // namespace roadvec
