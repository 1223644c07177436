#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <iterator>
#include <mutex>
#include <utility>
#include <vector>

#include "core/graph/keyframe_store.h"
#include "core/graph/pose_graph.h"

namespace roadvec {

/// A keyframe as a later drive needs it. Noted again it takes the place of what was noted before.
struct JournalKeyframe {
  std::uint64_t number = 0;  ///< 0, 1, 2, ... in the graph, those of earlier drives first
  KeptKeyframe kept;
  PoseEdge step;  ///< from the keyframe before it
  double travelled_m = 0;
  Pose2 T_map_vehicle;  ///< when it came; loops may have moved it since
};

/// What the optimiser did since the store looked last.
struct JournalNews {
  std::vector<JournalKeyframe> keyframes;
  std::vector<PoseEdge> loops;
  bool found_itself = false;  ///< the map continues that of the earlier drive,
  bool recalled_all = false;  ///< and holds all its lines
};

/// Optimiser thread -> store thread: what the map was made from, beside the log of what it became. A change of the map
/// is published after what it was made from was noted here.
class DriveJournal {
 public:
  void note(JournalNews news) {
    const std::scoped_lock lock(mutex_);
    JournalNews& to = maps_.back();
    std::ranges::move(news.keyframes, std::back_inserter(to.keyframes));
    std::ranges::move(news.loops, std::back_inserter(to.loops));
    to.found_itself = to.found_itself || news.found_itself;
    to.recalled_all = to.recalled_all || news.recalled_all;
  }
  void begin_new_map() {
    const std::scoped_lock lock(mutex_);
    maps_.emplace_back();
  }

  /// Of the map that the store keeps now.
  [[nodiscard]] JournalNews take() {
    const std::scoped_lock lock(mutex_);
    return std::exchange(maps_.front(), {});
  }
  /// The store goes on to the next map; takes the last of this one.
  [[nodiscard]] JournalNews take_last() {
    const std::scoped_lock lock(mutex_);
    JournalNews last = std::move(maps_.front());
    maps_.pop_front();
    return last;
  }

 private:
  std::mutex mutex_;
  std::deque<JournalNews> maps_{1};
};

}  // namespace roadvec
