#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <vector>

#include "tools/replay/track.h"

namespace roadvec {

struct PlayPlan {
  double speed = 1.0;
  bool as_fast_as_possible = false;
  bool loop = false;
  double from_s = 0.0, to_s = 1e9;  ///< after the drive's first stamp
};

struct PlayReport {
  double played_s = 0;          ///< of recorded time
  double taken_s = 0;           ///< of real time
  double worst_lateness_s = 0;  ///< of an item, against its due time
  std::uint64_t loop_count = 0;
  bool interrupted = false;
};

/// Plays tracks side by side, merged by their stamps, each item at its due time on CLOCK_MONOTONIC.
class Player {
 public:
  using Tracks = std::vector<std::unique_ptr<Track>>;
  /// `tell` gets the report about once a second; `stop` ends the replay within 0.1 s.
  Player(const PlayPlan& plan, const Tracks& tracks, const std::atomic<bool>& stop,
         std::function<void(const PlayReport&)> tell);

  /// Opens every recording once: all later rewinds are of files that could be read.
  [[nodiscard]] Expected<PlayReport> run();

 private:
  struct Head {
    Track* track;
    SensorTime time;
  };
  [[nodiscard]] Expected<void> rewind();
  [[nodiscard]] Head* earliest();
  void advance(Head& head);
  bool play_once(std::int64_t start_ns);
  void sleep_until(std::int64_t due_ns) const;
  void note_progress(std::int64_t now_ns);

  PlayPlan plan_;
  const Tracks& tracks_;
  const std::atomic<bool>& stop_;
  std::function<void(const PlayReport&)> tell_;
  std::vector<Head> heads_;  ///< one for each track that has an output and is not at its end
  SensorTime begin_, end_;   ///< of what is played
  std::int64_t begun_ns_ = 0, told_ns_ = 0;
  double played_before_s_ = 0;  ///< in the loops before this one
  PlayReport report_;
};

}  // namespace roadvec
