#include "drivers/velodyne/assemble.h"

#include <algorithm>
#include <cmath>

namespace roadvec {
namespace {

/// No revolution takes this long, and Return::time_ns must not run over.
constexpr std::int64_t kLongestSweep_ns = 1'000'000'000;

}  // namespace

SweepAssembler::SweepAssembler(const AssembleOptions& options, LidarModel model, SweepSink& sink,
                               LidarCounters& counters)
    : cut_cdeg_(static_cast<int>(std::lround(deg_from_rad(wrap_rad(options.cut_azimuth_rad)) * 100.0)) +
                kFullCircle_cdeg),
      group_span_ns_(group_span_ns(model)),
      max_groups_(max_groups_per_sweep(model)),
      sink_(sink),
      counters_(counters) {}

void SweepAssembler::add(const DecodedPacket& packet, const PacketTiming& timing) noexcept {
  if (timing.apart && turning_) {
    end_sweep(false);
    turning_ = false;
  }
  const SensorTime first_firing = timing.first_firing;
  bool torn = timing.lost_before_count > 0;
  for (int g = 0; g < packet.group_count; ++g) {
    const DecodedPacket::Group& group = packet.groups[static_cast<std::size_t>(g)];
    const SensorTime group_start = first_firing + group.start_ns;
    if (!group.usable) {
      torn = true;
      continue;
    }
    turn_to(group.azimuth_cdeg, torn, group_start);
    torn = false;
    append(packet, group, first_firing, group_start + group_span_ns_);
  }
  if (torn) whole_ = false;
}

/// Moves the head on to `azimuth_cdeg`, into the next sweep if that is past the cut. `torn`: something is missing
/// before it.
void SweepAssembler::turn_to(std::uint16_t azimuth_cdeg, bool torn, SensorTime group_start) noexcept {
  const int behind_cut_cdeg = (azimuth_cdeg - cut_cdeg_ + 2 * kFullCircle_cdeg) % kFullCircle_cdeg;
  if (!turning_) {
    turning_ = true;
    position_cdeg_ = behind_cut_cdeg;
    last_time_ = group_start;
    begin_sweep(group_start, false);
    return;
  }
  const int here_cdeg = ((position_cdeg_ % kFullCircle_cdeg) + kFullCircle_cdeg) % kFullCircle_cdeg;
  int step_cdeg = azimuth_step_cdeg(here_cdeg, behind_cut_cdeg);
  if (step_cdeg < -kLargestStep_cdeg) step_cdeg += kFullCircle_cdeg;
  if (step_cdeg > kLargestStep_cdeg) torn = true;
  if (torn) whole_ = false;
  position_cdeg_ = std::max(position_cdeg_ + step_cdeg, -kFullCircle_cdeg);
  if (position_cdeg_ >= kFullCircle_cdeg) {
    position_cdeg_ -= kFullCircle_cdeg;
    end_sweep(whole_);
    begin_sweep(group_start, !torn);
  } else if (sweep_ != nullptr &&
             (++sweep_group_count_ > max_groups_ || group_start - sweep_->start > kLongestSweep_ns)) {
    counters_.head_stopped.add();
    sweep_ = nullptr;  // withdrawn; the next sweep begins when the head passes the cut
  }
}

void SweepAssembler::begin_sweep(SensorTime start, bool whole) noexcept {
  const std::uint64_t index = next_index_++;
  whole_ = whole;
  sweep_group_count_ = 1;
  sweep_ = sink_.claim();
  if (sweep_ == nullptr) {
    counters_.ring_full.add();
    return;
  }
  sweep_->start = std::max(start, last_time_);
  sweep_->end = sweep_->start;
  sweep_->index = index;
  sweep_->complete = false;
  sweep_->returns.clear();
}

void SweepAssembler::end_sweep(bool whole) noexcept {
  if (sweep_ == nullptr) return;
  sweep_->end = last_time_;
  sweep_->complete = whole;
  sweep_ = nullptr;
  sink_.publish();
}

void SweepAssembler::append(const DecodedPacket& packet, const DecodedPacket::Group& group, SensorTime first_firing,
                            SensorTime group_end) noexcept {
  if (sweep_ != nullptr) {
    std::vector<Return>& returns = sweep_->returns;
    const std::size_t count = group.returns_end - group.returns_begin;
    const std::size_t taken = std::min(count, returns.capacity() - returns.size());
    if (taken < count) {
      counters_.sweep_overflow.add(count - taken);
      whole_ = false;
    }
    const std::size_t begin = returns.size();
    const Return* const source = packet.returns.data() + group.returns_begin;
    returns.insert(returns.end(), source, source + taken);
    // A packet that arrived early would reach back into the one before it: its first firings take that one's last time.
    const std::int64_t shift_ns = first_firing - sweep_->start;
    const std::int64_t earliest_ns = last_time_ - sweep_->start;
    for (std::size_t i = begin; i < returns.size(); ++i) {
      const std::int64_t time_ns = std::max(shift_ns + returns[i].time_ns, earliest_ns);
      returns[i].time_ns = static_cast<std::uint32_t>(time_ns);
    }
  }
  last_time_ = std::max(last_time_, group_end);
}

void SweepAssembler::finish() noexcept {
  end_sweep(false);
  turning_ = false;
}

}  // namespace roadvec
