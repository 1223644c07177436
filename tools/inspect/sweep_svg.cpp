#include "tools/inspect/sweep_svg.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>

namespace roadvec {
namespace {

constexpr double kReach_m = 40, kCell_m = 0.2;
constexpr int kPixelsPerMetre = 10, kSide_px = static_cast<int>(2 * kReach_m) * kPixelsPerMetre;

struct Band {
  float below_m;  ///< the sensor's height is 0
  const char* colour;
};
// From cold to warm; a sensor on a roof is about 1.8 m above the road.
constexpr std::array<Band, 7> kBands{{{-2.2F, "#440154"},
                                      {-1.6F, "#3b528b"},
                                      {-1.2F, "#21918c"},
                                      {-0.5F, "#5ec962"},
                                      {0.5F, "#b8a800"},
                                      {2.0F, "#f98e09"},
                                      {1e9F, "#bc3754"}}};

std::size_t band_of(float z_m) {
  return static_cast<std::size_t>(std::ranges::find_if(kBands, [z_m](const Band& band) { return z_m < band.below_m; }) -
                                  kBands.begin());
}

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '&')
      result += "&amp;";
    else if (c == '<')
      result += "&lt;";
    else
      result += c;
  }
  return result;
}

}  // namespace

std::string svg_of_sweep(const std::vector<Return>& returns, const std::string& title) {
  // The highest echo of each cell: what an eye from above would see.
  std::map<std::pair<int, int>, float> cells;
  for (const Return& r : returns) {
    if (std::abs(r.x_m) >= kReach_m || std::abs(r.y_m) >= kReach_m) continue;
    const std::pair cell{static_cast<int>(std::floor(r.x_m / kCell_m)), static_cast<int>(std::floor(r.y_m / kCell_m))};
    const auto [entry, is_new] = cells.try_emplace(cell, r.z_m);
    if (!is_new) entry->second = std::max(entry->second, r.z_m);
  }
  constexpr int kCell_px = static_cast<int>(kCell_m * kPixelsPerMetre), kMiddle_px = kSide_px / 2;
  std::array<std::string, kBands.size()> paths;
  for (const auto& [cell, z_m] : cells) {
    // x ahead is up in the picture, y left is left.
    paths[band_of(z_m)] += "M" + std::to_string(kMiddle_px - (cell.second + 1) * kCell_px) + " " +
                           std::to_string(kMiddle_px - (cell.first + 1) * kCell_px) + "h2v2h-2z";
  }
  const std::string side = std::to_string(kSide_px), middle = std::to_string(kMiddle_px);
  std::string svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " + side + " " + side +
                    "\" font-family=\"sans-serif\" font-size=\"14\">\n<rect width=\"100%\" height=\"100%\" "
                    "fill=\"white\"/>\n";
  for (int ring_m = 10; ring_m <= static_cast<int>(kReach_m); ring_m += 10) {
    svg += "<circle cx=\"" + middle + "\" cy=\"" + middle + "\" r=\"" + std::to_string(ring_m * kPixelsPerMetre) +
           "\" fill=\"none\" stroke=\"#ddd\"/>\n";
  }
  for (std::size_t i = 0; i < paths.size(); ++i) {
    if (!paths[i].empty()) svg += std::string("<path fill=\"") + kBands[i].colour + "\" d=\"" + paths[i] + "\"/>\n";
  }
  svg += "<path d=\"M" + middle + " " + std::to_string(kMiddle_px - 12) + "l7 18h-14z\" fill=\"black\"/>\n";
  svg += "<text x=\"10\" y=\"20\">" + escaped(title) + "; rings every 10 m, ahead is up</text>\n</svg>\n";
  return svg;
}

}  // namespace roadvec
