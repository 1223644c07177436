#include "tools/simulate/echo.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "tools/simulate/world.h"

namespace roadvec {
namespace {

/// Two echoes of one pulse are told apart from here on. [VelodyneVLS128, p. 32]
constexpr double kSeparable_m = 1.0;
/// Half of the way that light goes during a pulse of 5 ns: an echo smeared over more is that much weaker.
constexpr double kPulse_m = 0.75;
// The maker's ranges for pavement of 0.1 and cars of 0.8, 50 and 120 m, give the weakest power that is heard and what
// the air and the optics take with distance. [VelodyneHDL64ES3]
constexpr double kWeakest_1pm2 = 3.16e-5;
constexpr double kExtinction_1pm = 2 * 0.00235;  ///< there and back
constexpr double kFilmMirrors = 0.02;            ///< of light that meets water or lacquer straight on
constexpr double kFilmGlint = 3.0;               ///< brightness of such a mirror seen straight on
constexpr double kWetDarkens = 0.5;

/// Of a clear film: the share of light that it mirrors [Schlick1994].
double mirrored(double cosine) {
  const double c = 1 - cosine;
  return kFilmMirrors + (1 - kFilmMirrors) * c * c * c * c * c;
}

/// Poles have one number for all of them.
bool same_surface(std::int32_t a, std::int32_t b) { return a == b && (a >= 0 || a == Hit::kGround); }

/// By material; what the scene says of reflectivity comes on top.
constexpr std::array<Surface, kMaterialCount> kSurfaces{{
    {.roughness_rad = 0.45},               // road
    {.roughness_rad = 0.35},               // kerb
    {.roughness_rad = 0.45},               // sidewalk
    {.roughness_rad = 0.2},                // wall
    {.roughness_rad = 0.1, .gloss = 0.3},  // pole
    {.roughness_rad = 0.35},               // tree
    {.gloss = 0.9},                        // car
    {.roughness_rad = 0.6},                // grass
    {.roughness_rad = 0.5},                // gravel
    {.roughness_rad = 0.5},                // hedge
    {.gloss = 1, .clear = 0.85},           // glass
    {.roughness_rad = 0.1, .gloss = 0.5},  // metal
    {.roughness_rad = 0.35},               // fence
    {.roughness_rad = 0.35},               // person
}};

}  // namespace

std::array<Surface, kMaterialCount> surfaces_of(const Scene& scene) {
  std::array<Surface, kMaterialCount> surfaces = kSurfaces;
  for (std::size_t i = 0; i < surfaces.size(); ++i) surfaces[i].reflectivity = scene.reflectivity[i];
  for (const Material ground : {Material::road, Material::sidewalk, Material::kerb, Material::gravel}) {
    Surface& surface = surfaces[static_cast<std::size_t>(ground)];
    surface.reflectivity *= 1 - kWetDarkens * scene.lidar.wet;
    surface.gloss = scene.lidar.wet;
  }
  return surfaces;
}

double brightness(const Surface& surface, double cosine) {
  const double sine2 = 1 - cosine * cosine, slope2 = surface.roughness_rad * surface.roughness_rad;
  // Oren and Nayar's rough surface, seen from where the light comes from.
  const double scattered =
      surface.reflectivity * ((1 - 0.5 * slope2 / (slope2 + 0.33)) * cosine + 0.45 * slope2 / (slope2 + 0.09) * sine2);
  if (surface.gloss == 0) return (1 - surface.clear) * scattered;
  const double through = 1 - mirrored(cosine);  // once on the way in, once on the way out
  constexpr double kGlintDies = 0.005;
  const double off = (1 - cosine) / kGlintDies;
  const double glint = off < 40 ? kFilmGlint * kFilmMirrors * std::exp(-off) : 0;
  return (1 - surface.clear) * (1 - surface.gloss + surface.gloss * through * through) * scattered +
         surface.gloss * glint;
}

Echoes echoes_of(std::span<SubRay> parts) {
  Echoes echoes;
  for (std::size_t i = 1; i < parts.size(); ++i) {
    for (std::size_t k = i; k > 0 && parts[k].range_m < parts[k - 1].range_m; --k) std::swap(parts[k], parts[k - 1]);
  }
  for (std::size_t first = 0; first < parts.size() && std::isfinite(parts[first].range_m);) {
    Echo& echo = echoes.list[echoes.count];
    double most = 0, range_sum_m = 0, power_sum = 0;
    std::size_t i = first;
    for (; i < parts.size() && std::isfinite(parts[i].range_m); ++i) {
      const SubRay& part = parts[i];
      const bool apart = i > first && part.range_m > parts[i - 1].range_m + kSeparable_m;
      if (apart && !same_surface(part.face, parts[i - 1].face)) break;
      const double power = part.weight * part.brightness / (part.range_m * part.range_m);
      range_sum_m += power * part.range_m;
      power_sum += power;
      echo.brightness += part.weight * part.brightness;
      if (power > most) echo.face = part.face;
      most = std::max(most, power);
    }
    const double smear = kPulse_m / std::max(kPulse_m, parts[i - 1].range_m - parts[first].range_m);
    first = i;
    if (power_sum <= 0) continue;  // all of it lost behind glass
    echo.range_m = range_sum_m / power_sum;
    echo.power = smear * power_sum * std::exp(-kExtinction_1pm * echo.range_m) / kWeakest_1pm2;
    ++echoes.count;
  }
  return echoes;
}

}  // namespace roadvec
