#include "tools/import/round_trip.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "drivers/velodyne/decode.h"
#include "drivers/velodyne/pcap_reader.h"

namespace roadvec {
namespace {

/// Errors counted in steps, because a drive has millions of points.
class Quantiles {
 public:
  void add(double error_m) {
    ++counts_[std::min(static_cast<std::size_t>(error_m / kStep_m), counts_.size() - 1)];
    ++count_;
    max_m_ = std::max(max_m_, error_m);
  }
  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] double max_m() const { return max_m_; }
  /// To a step, upwards; beyond the last step, the largest.
  [[nodiscard]] double at(double share) const {
    std::uint64_t below = 0;
    for (std::size_t i = 0; i + 1 < counts_.size(); ++i) {
      below += counts_[i];
      if (static_cast<double>(below) >= share * static_cast<double>(count_))
        return static_cast<double>(i + 1) * kStep_m;
    }
    return max_m_;
  }

 private:
  static constexpr double kStep_m = 1e-5;
  std::array<std::uint64_t, 10'000> counts_{};
  std::uint64_t count_ = 0;
  double max_m_ = 0;
};

/// The firings that went in, one by one.
class Expectation {
 public:
  explicit Expectation(const std::function<std::vector<Firing>()>& next_revolution)
      : next_revolution_(next_revolution) {}

  /// Null at the end.
  const Firing* front() {
    if (at_ == firings_.size() && !over_) {
      firings_ = next_revolution_();
      over_ = firings_.empty();
      at_ = 0;
    }
    return at_ < firings_.size() ? &firings_[at_] : nullptr;
  }
  void pop() { ++at_; }

 private:
  const std::function<std::vector<Firing>()>& next_revolution_;
  std::vector<Firing> firings_;
  std::size_t at_ = 0;
  bool over_ = false;
};

std::size_t echo_count(const Firing& firing) {
  return kHeadLasers - static_cast<std::size_t>(std::count(firing.raw.begin(), firing.raw.end(), 0));
}

double distance_m(const Return& decoded, const KittiPoint& point) {
  return std::hypot(static_cast<double>(decoded.x_m - point.x_m), static_cast<double>(decoded.y_m - point.y_m),
                    static_cast<double>(decoded.z_m - point.z_m));
}

}  // namespace

Expected<RoundTrip> check_round_trip(const std::filesystem::path& pcap, const std::filesystem::path& calibration,
                                     const std::function<std::vector<Firing>()>& next_revolution) {
  LidarCounters counters;
  const auto table = calibration_for(LidarModel::hdl64e_s2, calibration);
  if (!table) return tl::unexpected(table.error());
  auto reader = PcapReader::open(pcap, {}, counters);
  if (!reader) return tl::unexpected(reader.error());
  PacketDecoder decoder(LidarModel::hdl64e_s2, *table, {}, counters);
  Expectation expected(next_revolution);
  Quantiles errors;
  RoundTrip report;
  DecodedPacket decoded;
  const auto compare = [&](const DecodedPacket::Group& group) {
    const Firing* firing = expected.front();
    const std::size_t return_count = group.returns_end - group.returns_begin;
    if (firing == nullptr) return;
    // A packet before a gap is filled up with firings that nothing went into.
    if (return_count == 0 && echo_count(*firing) > 0) return;
    report.missing_count += echo_count(*firing) - std::min(return_count, echo_count(*firing));
    for (std::uint32_t i = group.returns_begin; i < group.returns_end; ++i) {
      errors.add(distance_m(decoded.returns[i], firing->points[decoded.returns[i].laser]));
    }
    expected.pop();
  };
  std::span<const RawPacket> batch;
  for (;;) {
    const ReadResult result = (*reader)->read(batch, std::chrono::milliseconds(0));
    if (result == ReadResult::failed) return fail(std::string((*reader)->error()));
    for (const RawPacket& packet : batch) {
      if (!decoder.decode(packet.bytes, decoded)) continue;
      for (int g = 0; g < decoded.group_count; ++g) compare(decoded.groups[static_cast<std::size_t>(g)]);
    }
    if (result == ReadResult::end) break;
  }
  for (; expected.front() != nullptr; expected.pop()) report.missing_count += echo_count(*expected.front());
  report.point_count = errors.count();
  report.median_m = errors.at(0.5);
  report.quantile95_m = errors.at(0.95);
  report.max_m = errors.max_m();
  return report;
}

}  // namespace roadvec
