#pragma once

#include <set>
#include <string_view>
#include <vector>

#include "core/map/tiles.h"
#include "core/map/vector_map.h"
#include "core/wire/messages.h"
#include "daemon/server/map_publisher.h"

namespace roadvec {

/// The store's own copy of the map, line by line, made of the frames that the log carries; and which lines have changed
/// since they were last written. A change carries all pieces of every line that it touches, so lines come together
/// without looking at tiles.
class MapCopy {
 public:
  explicit MapCopy(MapHead start) : head_(start), newest_(start) {}

  /// Takes a whole frame. false: it does not continue what came before.
  [[nodiscard]] bool take(std::string_view frame);

  [[nodiscard]] const VectorMap& map() const { return map_; }
  /// The newest change that is complete: those in several frames count with their last.
  [[nodiscard]] MapHead head() const { return head_; }
  [[nodiscard]] const std::set<LineId>& changed() const { return changed_; }
  void written() { changed_.clear(); }
  void changed(LineId line) { changed_.insert(line); }
  void all_changed();
  /// The last frame said that the map begins anew: map() is still the one before, and head() its end, until let_go().
  [[nodiscard]] bool begins_anew() const { return begins_anew_; }
  void let_go();

 private:
  bool apply(const wire::Delta& delta);
  bool apply(const wire::EpochChange& change);
  bool apply(const auto&) { return false; }
  [[nodiscard]] bool complete();

  MapHead head_, newest_;  ///< newest_: of frames, in the middle of a change too
  VectorMap map_;
  std::set<LineId> changed_;
  std::vector<TilePiece> pieces_;  ///< of the change that is arriving
  std::set<LineId> left_;          ///< lines that it takes out of a tile
  bool begins_anew_ = false;
};

}  // namespace roadvec
