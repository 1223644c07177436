#include <algorithm>
#include <array>
#include <cmath>

#include "daemon/server/map_files.h"
#include "daemon/server/text_writer.h"

namespace roadvec {
namespace {

constexpr double kMargin_px = 28, kHeader_px = 58, kFooter_px = 64, kLongSide_px = 1400, kLeastWidth_px = 760,
                 kLeastHeight_px = 300;

struct Style {
  BoundaryKind kind;
  const char* label;
  const char* colour;  ///< told apart by people with any colour vision: hues of [OkabeIto2008]
};
constexpr std::array<Style, 5> kStyles{{{BoundaryKind::curb, "curb", "#0072b2"},
                                        {BoundaryKind::barrier, "barrier", "#d55e00"},
                                        {BoundaryKind::vegetation, "vegetation", "#009e73"},
                                        {BoundaryKind::vehicle_row, "vehicle row", "#cc79a7"},
                                        {BoundaryKind::unknown, "unknown", "#7d8590"}}};

/// Metres of the map frame to pixels, y down.
struct View {
  Eigen::Vector2d low_m{0, 0}, high_m{20, 20};
  double px_per_m = 1, width_px = 0, height_px = 0;

  [[nodiscard]] Eigen::Vector2d px(const Eigen::Vector2d& p_m) const {
    const Eigen::Vector2d centre_m = (low_m + high_m) / 2;
    return {width_px / 2 + (p_m.x() - centre_m.x()) * px_per_m,
            kHeader_px + (height_px - kHeader_px - kFooter_px) / 2 - (p_m.y() - centre_m.y()) * px_per_m};
  }
};

View view_of(const VectorMap& map, std::span<const Eigen::Vector2d> trajectory) {
  View view;
  bool any = false;
  const auto include = [&](const Eigen::Vector2d& p) {
    view.low_m = any ? view.low_m.cwiseMin(p).eval() : p;
    view.high_m = any ? view.high_m.cwiseMax(p).eval() : p;
    any = true;
  };
  for (const auto& [id, line] : map) {
    for (const Vertex& v : line.vertices) include(v.position());
  }
  for (const Eigen::Vector2d& p : trajectory) include(p);
  const Eigen::Vector2d size_m = (view.high_m - view.low_m).cwiseMax(20.0);
  view.px_per_m = (kLongSide_px - 2 * kMargin_px) / size_m.maxCoeff();
  view.width_px = std::max(size_m.x() * view.px_per_m + 2 * kMargin_px, kLeastWidth_px);
  view.height_px = std::max(size_m.y() * view.px_per_m, kLeastHeight_px) + 2 * kMargin_px + kHeader_px + kFooter_px;
  return view;
}

/// 1, 2 or 5 times a power of ten, at most `most`.
double round_length(double most) {
  const double decade = std::pow(10, std::floor(std::log10(most)));
  for (const double step : {5.0, 2.0}) {
    if (step * decade <= most) return step * decade;
  }
  return decade;
}

std::string px(double value) { return decimal(value, 1); }

std::string escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    result += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : byte < 0x20 ? " " : std::string(1, c);
  }
  return result;
}

std::string text_at(double x, double y, const std::string& attributes, std::string_view text) {
  return "<text x=\"" + px(x) + "\" y=\"" + px(y) + "\" " + attributes + ">" + escaped(text) + "</text>\n";
}

template <class Points, class Position>
std::string polyline(const View& view, const Points& points, Position&& position) {
  std::string text = "<polyline points=\"";
  for (const auto& point : points) {
    const Eigen::Vector2d at = view.px(position(point));
    text += px(at.x()) + "," + px(at.y()) + " ";
  }
  return text + "\"/>\n";
}

std::string grid(const View& view) {
  const double step_m = round_length(160 / view.px_per_m);
  const double half_width_m = view.width_px / 2 / view.px_per_m;
  const double half_height_m = (view.height_px - kHeader_px - kFooter_px) / 2 / view.px_per_m;
  const Eigen::Vector2d centre_m = (view.low_m + view.high_m) / 2;
  std::string text = "<g stroke=\"#e4e7eb\" stroke-width=\"1\">\n";
  for (double i = std::ceil((centre_m.x() - half_width_m) / step_m); i * step_m <= centre_m.x() + half_width_m; ++i) {
    const std::string x = px(view.px({i * step_m, 0}).x());
    text += "<path d=\"M" + x + " " + px(kHeader_px) + "V" + px(view.height_px - kFooter_px) + "\"/>\n";
  }
  for (double i = std::ceil((centre_m.y() - half_height_m) / step_m); i * step_m <= centre_m.y() + half_height_m; ++i) {
    text += "<path d=\"M0 " + px(view.px({0, i * step_m}).y()) + "H" + px(view.width_px) + "\"/>\n";
  }
  return text + "</g>\n";
}

std::string lines(const View& view, const VectorMap& map) {
  std::string text;
  // The surest last, so that they lie on top.
  for (auto style = kStyles.rbegin(); style != kStyles.rend(); ++style) {
    text += "<g stroke=\"" + std::string(style->colour) + "\" stroke-width=\"2.4\">\n";
    for (const auto& [id, line] : map) {
      if (line.attributes.kind != style->kind) continue;
      text += polyline(view, line.vertices, [](const Vertex& v) { return v.position(); });
    }
    text += "</g>\n";
  }
  return text;
}

std::string trajectory_line(const View& view, std::span<const Eigen::Vector2d> trajectory) {
  if (trajectory.size() < 2) return {};
  const Eigen::Vector2d end = view.px(trajectory.back());
  return "<g stroke=\"#1f2933\" stroke-width=\"1.6\" stroke-dasharray=\"7 5\">\n" +
         polyline(view, trajectory, [](const Eigen::Vector2d& p) { return p; }) + "</g>\n<circle cx=\"" + px(end.x()) +
         "\" cy=\"" + px(end.y()) + "\" r=\"5\" fill=\"#1f2933\"/>\n";
}

std::string legend(const View& view, bool with_trajectory) {
  double x = kMargin_px;
  const double y = view.height_px - kFooter_px / 2;
  std::string text;
  const auto entry = [&](const std::string& stroke, const std::string& label) {
    text += "<path d=\"M" + px(x) + " " + px(y) + "h26\" " + stroke + "/>\n";
    text += text_at(x + 33, y + 4.5, "font-size=\"14\"", label);
    x += 58 + 7.6 * static_cast<double>(label.size());
  };
  for (const Style& style : kStyles)
    entry("stroke=\"" + std::string(style.colour) + "\" stroke-width=\"4\"", style.label);
  if (with_trajectory) entry("stroke=\"#1f2933\" stroke-width=\"1.6\" stroke-dasharray=\"7 5\"", "trajectory");
  return text;
}

std::string scale_bar(const View& view) {
  const double length_m = round_length(150 / view.px_per_m), length_px = length_m * view.px_per_m;
  const double x = view.width_px - kMargin_px - length_px, y = view.height_px - kFooter_px / 2 + 6;
  const std::string label =
      length_m >= 1000 ? decimal(length_m / 1000, 0) + " km" : decimal(length_m, length_m < 1 ? 1 : 0) + " m";
  return "<path d=\"M" + px(x) + " " + px(y - 6) + "v6h" + px(length_px) +
         "v-6\" fill=\"none\" stroke=\"#1f2933\" stroke-width=\"2\"/>\n" +
         text_at(x + length_px / 2, y - 9, "font-size=\"14\" text-anchor=\"middle\"", label);
}

std::string north_arrow(const View& view) {
  const double x = view.width_px - kMargin_px - 8;
  return "<path d=\"M" + px(x) + " 14l8 26l-8 -6l-8 6z\" fill=\"#1f2933\"/>\n" +
         text_at(x, 53, "font-size=\"13\" text-anchor=\"middle\" font-weight=\"600\"", "N");
}

}  // namespace

std::string svg_of(const VectorMap& map, std::span<const Eigen::Vector2d> trajectory, std::string_view title) {
  const View view = view_of(map, trajectory);
  const std::string width = px(view.width_px), height = px(view.height_px);
  const Eigen::Vector2d size_m = view.high_m - view.low_m;
  const std::string facts = std::to_string(map.size()) + " lines, " + decimal(length_m(map), 1) + " m, area " +
                            decimal(size_m.x(), 0) + " × " + decimal(size_m.y(), 0) + " m";
  std::string text = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" + width + "\" height=\"" + height +
                     "\" viewBox=\"0 0 " + width + " " + height +
                     "\" font-family=\"system-ui, 'DejaVu Sans', sans-serif\" fill=\"#1f2933\">\n" +
                     "<rect width=\"100%\" height=\"100%\" fill=\"#fbfcfd\"/>\n";
  text += grid(view);
  text += "<g fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\">\n" + lines(view, map) + "</g>\n";
  text += "<g fill=\"none\">\n" + trajectory_line(view, trajectory) + "</g>\n";
  text += "<rect width=\"100%\" height=\"" + px(kHeader_px) + "\" fill=\"#fbfcfd\"/>\n";
  text += "<rect y=\"" + px(view.height_px - kFooter_px) + "\" width=\"100%\" height=\"" + px(kFooter_px) +
          "\" fill=\"#fbfcfd\"/>\n";
  text += text_at(kMargin_px, 27, "font-size=\"19\" font-weight=\"600\"", title);
  text += text_at(kMargin_px, 48, "font-size=\"14\" fill=\"#52606d\"", facts);
  text += north_arrow(view);
  text += legend(view, trajectory.size() >= 2) + scale_bar(view);
  return text + "</svg>\n";
}

}  // namespace roadvec
