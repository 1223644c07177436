#include "tools/score/boundary_score.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/map/segment_index.h"

namespace roadvec {
namespace {

constexpr double kGate_m = kTolerances_m.back();
constexpr double kBin_m = 0.5;          // pieces of truth that are covered or not
constexpr double kCovered_m = 0.3;      // a map line this near covers the truth
constexpr double kLeastInBin_m = 0.25;  // less of a line in a bin only passes by
constexpr std::array kKinds{BoundaryKind::curb, BoundaryKind::barrier, BoundaryKind::vegetation,
                            BoundaryKind::vehicle_row, BoundaryKind::unknown};

/// Finds the nearest place on a set of lines, and how far along its line that is.
class Nearest {
 public:
  explicit Nearest(const LineSet& lines) : index_(1.0) {
    index_.build(lines);
    double before_m = 0;
    for (const SegmentIndex::Item& item : index_.items()) {
      if (item.first_of_line) before_m = 0;
      before_m_.push_back(before_m);
      before_m += item.length_m;
    }
  }
  struct Place {
    double distance_m = 0;
    std::uint32_t line = 0;
    double along_m = 0;
  };
  [[nodiscard]] std::optional<Place> find(const Eigen::Vector2d& p_m, double gate_m) const {
    const auto hit = index_.nearest(p_m, Eigen::Vector2d::UnitX(), {.distance_m = gate_m});
    if (!hit) return std::nullopt;
    return Place{std::sqrt(hit->distance2_m2), index_.items()[hit->item].line, before_m_[hit->item] + hit->along_m};
  }

 private:
  SegmentIndex index_;
  std::vector<double> before_m_;  // of each item: length of its line before it
};

std::vector<std::optional<double>> distances_m(const std::vector<LineSample>& samples, const Nearest& nearest,
                                               double gate_m) {
  std::vector<std::optional<double>> distances;
  for (const LineSample& s : samples) {
    const auto place = nearest.find(s.position_m, gate_m);
    distances.push_back(place ? std::optional(place->distance_m) : std::nullopt);
  }
  return distances;
}

/// Share of the samples' length that has a counterpart within `tolerance_m`; nothing to find is found whole.
double share_within(const std::vector<LineSample>& samples, const std::vector<std::optional<double>>& distances,
                    double tolerance_m) {
  double near_m = 0, all_m = 0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    all_m += samples[i].length_m;
    if (distances[i] && *distances[i] <= tolerance_m) near_m += samples[i].length_m;
  }
  return all_m > 0 ? near_m / all_m : 1.0;
}

KindScore score_kind(const std::string& kind, const LineSet& map, const LineSet& truth,
                     const std::vector<LineSample>& map_samples, const std::vector<LineSample>& visible_samples) {
  KindScore score{.kind = kind, .map_m = length_m(map_samples), .truth_m = length_m(visible_samples)};
  const auto to_truth = distances_m(map_samples, Nearest(truth), kGate_m),
             to_map = distances_m(visible_samples, Nearest(map), kGate_m);
  for (std::size_t t = 0; t < kTolerances_m.size(); ++t) {
    const double p = score.precision[t] = share_within(map_samples, to_truth, kTolerances_m[t]);
    const double r = score.recall[t] = share_within(visible_samples, to_map, kTolerances_m[t]);
    score.f1[t] = p + r > 0 ? 2 * p * r / (p + r) : 0;
  }
  return score;
}

LineSet of_kind(const LineSet& lines, BoundaryKind kind) {
  LineSet some;
  for (const LineSet::Line& line : lines.lines()) {
    if (line.attributes.kind != kind) continue;
    some.begin_line(line.attributes);
    for (const Vertex& vertex : lines.vertices_of(line)) some.push_vertex(vertex);
  }
  return some;
}

void add_lateral_errors(const std::vector<LineSample>& map_samples, const Nearest& truth, BoundaryScore& score) {
  std::vector<double> errors_m;
  double sum_m = 0;
  for (const auto& distance : distances_m(map_samples, truth, kGate_m)) {
    if (!distance) continue;
    errors_m.push_back(*distance);
    sum_m += *distance;
  }
  if (errors_m.empty()) return;
  std::sort(errors_m.begin(), errors_m.end());
  score.lateral_median_m = errors_m[errors_m.size() / 2];
  score.lateral_95_m = errors_m[errors_m.size() * 95 / 100];
  score.lateral_mean_m = sum_m / static_cast<double>(errors_m.size());
}

/// A piece of truth: how often the map runs along it, and with which lines.
struct Bin {
  int pass_count = 0;
  std::set<std::uint32_t> lines;
};
using BinKey = std::pair<std::uint32_t, int>;  // line of the truth, piece of it
BinKey bin_of(std::uint32_t line, double along_m) { return {line, static_cast<int>(along_m / kBin_m)}; }

std::map<BinKey, Bin> cover(const std::vector<LineSample>& map_samples, const Nearest& truth) {
  std::map<BinKey, Bin> bins;
  std::optional<BinKey> key;  // of the run of samples so far
  std::uint32_t line = 0;
  double run_m = 0;
  const auto end_run = [&] {
    if (key && run_m >= kLeastInBin_m) {
      Bin& bin = bins[*key];
      ++bin.pass_count;
      bin.lines.insert(line);
    }
    run_m = 0;
  };
  for (const LineSample& s : map_samples) {
    const auto place = truth.find(s.position_m, kCovered_m);
    const auto here = place ? std::optional(bin_of(place->line, place->along_m)) : std::nullopt;
    if (here != key || s.line != line) end_run();
    key = here;
    line = s.line;
    run_m += s.length_m;
  }
  end_run();
  return bins;
}

bool have_common(const std::set<std::uint32_t>& a, const std::set<std::uint32_t>& b) {
  return std::any_of(a.begin(), a.end(), [&b](std::uint32_t line) { return b.count(line) > 0; });
}

std::size_t count_breaks(const std::map<BinKey, Bin>& bins, const std::vector<LineSample>& truth_samples,
                         const std::vector<bool>& visible_truth) {
  std::set<BinKey> visible_bins;
  for (std::size_t i = 0; i < truth_samples.size(); ++i) {
    if (visible_truth[i]) visible_bins.insert(bin_of(truth_samples[i].line, truth_samples[i].along_m));
  }
  std::size_t break_count = 0;
  const Bin* last = nullptr;  // covered, with nothing but visible truth since
  std::optional<BinKey> before;
  for (const BinKey& key : visible_bins) {
    if (!before || before->first != key.first || before->second + 1 != key.second) last = nullptr;
    before = key;
    const auto bin = bins.find(key);
    if (bin == bins.end()) continue;
    if (last != nullptr && !have_common(last->lines, bin->second.lines)) ++break_count;
    last = &bin->second;
  }
  return break_count;
}

}  // namespace

std::vector<std::optional<double>> distances_m(const std::vector<LineSample>& samples, const LineSet& lines,
                                               double gate_m) {
  return distances_m(samples, Nearest(lines), gate_m);
}

std::vector<LineSample> samples_that_count(const LineSet& map, const Boundaries& truth) {
  const std::vector<LineSample> samples = sample(map, kSampleSpacing_m);
  const auto to_truth = distances_m(samples, truth.lines, kGate_m),
             to_optional = distances_m(samples, truth.optional_lines, kGate_m);
  std::vector<LineSample> counting;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!to_optional[i] || to_truth[i].value_or(kGate_m) <= *to_optional[i]) counting.push_back(samples[i]);
  }
  return counting;
}

BoundaryScore score_boundaries(const LineSet& map, const std::vector<LineSample>& map_samples, const LineSet& truth,
                               const std::vector<LineSample>& truth_samples, const std::vector<bool>& visible_truth) {
  std::vector<LineSample> visible_samples;
  for (std::size_t i = 0; i < truth_samples.size(); ++i) {
    if (visible_truth[i]) visible_samples.push_back(truth_samples[i]);
  }
  BoundaryScore score;
  score.truth_total_m = length_m(truth_samples);
  score.kinds.push_back(score_kind("all", map, truth, map_samples, visible_samples));
  for (const BoundaryKind kind : kKinds) {
    const auto is_kind = [kind](const LineSet& lines) {
      return [&lines, kind](const LineSample& s) { return lines.lines()[s.line].attributes.kind == kind; };
    };
    std::vector<LineSample> ours, theirs;
    std::copy_if(map_samples.begin(), map_samples.end(), std::back_inserter(ours), is_kind(map));
    std::copy_if(visible_samples.begin(), visible_samples.end(), std::back_inserter(theirs), is_kind(truth));
    if (ours.empty() && theirs.empty()) continue;
    score.kinds.push_back(
        score_kind(std::string(name_of(kind)), of_kind(map, kind), of_kind(truth, kind), ours, theirs));
  }
  const Nearest nearest_truth(truth);
  add_lateral_errors(map_samples, nearest_truth, score);
  const std::map<BinKey, Bin> bins = cover(map_samples, nearest_truth);
  int extra_pass_count = 0;
  for (const auto& [key, bin] : bins) extra_pass_count += bin.pass_count - 1;
  if (!bins.empty()) score.duplicated_percent = 100.0 * extra_pass_count / static_cast<double>(bins.size());
  score.break_count = count_breaks(bins, truth_samples, visible_truth);
  const double visible_m = length_m(visible_samples);
  if (visible_m > 0) score.breaks_per_100m = 100 * static_cast<double>(score.break_count) / visible_m;
  return score;
}

}  // namespace roadvec
