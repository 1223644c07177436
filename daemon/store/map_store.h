#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>

#include "daemon/server/frame_log.h"
#include "daemon/store/drive_journal.h"
#include "daemon/store/map_copy.h"
#include "daemon/store/map_file.h"
#include "daemon/store/recall.h"

namespace roadvec {

struct MapStoreConfig {
  std::filesystem::path directory;  ///< of map.gpkg; made if it is missing
  std::chrono::duration<double> batch_interval{2};
  std::chrono::milliseconds last_tries{5000};  ///< how long it tries to write the rest at the end; systemd gives 90 s
  MapHead start;                               ///< the same as the MapPublisher's
  Anchor anchor;
  std::optional<EarlierPart> earlier;  ///< that the optimiser recalls
};

/// What the main thread wants to know of the store.
struct StoreReport {
  std::string state = "opening";  ///< or "ok", "full", "locked", "replaced", "unwritable"
  std::string detail;             ///< what is wrong and what helps; what was set aside
  std::uint64_t durable_seq = 0;
  std::uint64_t batch_count = 0, failed_count = 0, opened_count = 0, set_aside_count = 0;
  std::uint64_t unwritten_line_count = 0;
  double file_bytes = 0, log_bytes = 0, longest_batch_ms = 0;
  bool in_trouble = false;
};

/// Thread `rv-store`: keeps directory/map.gpkg what the map is. It follows the log as a Reader, gathers what changed,
/// and commits that once in an interval: SQLite never comes near a real-time thread, nor the optimiser.
///
/// Whatever goes wrong with the file (disk full, locked, not writable, replaced, damaged), mapping goes on, report()
/// says it, and every interval it is tried again; the store holds the whole map, so that nothing is missing when the
/// cause is gone. What is not a map of ours, or no longer whole, is set aside under a name that says when and why, and
/// never overwritten.
class MapStore {
 public:
  /// Made before the log's writer starts.
  MapStore(const MapStoreConfig& config, FrameLog& log, DriveJournal& journal);

  /// Until stop; then writes what is left, trying for last_tries, and leaves one file without a log beside it. false:
  /// it lost the map because the log overran it (cannot happen while the writer asks has_room()).
  [[nodiscard]] bool run(const std::stop_token& stop);

  [[nodiscard]] StoreReport report() const;  ///< any thread

 private:
  using Clock = std::chrono::steady_clock;
  [[nodiscard]] bool take_new();
  void take(JournalNews news);
  void open();
  void begin_part();
  /// The map is empty, and none of it was ever written.
  [[nodiscard]] bool nothing_to_keep() const { return part_.number == 0 && copy_.map().empty(); }
  [[nodiscard]] Stored<void> find_part(const MapFile& file);
  void write(bool finished);
  [[nodiscard]] bool has_news(bool finished) const;
  void settle_earlier_parts();
  void finish();
  void close_moved();
  void set_aside(const StoreError& error);
  void meet(const StoreError& error);
  void count_batch(Clock::time_point begin);
  void say(const char* state, const std::string& trouble);

  MapStoreConfig config_;
  std::filesystem::path path_;
  FrameLog::Reader reader_;
  std::string frame_;
  MapCopy copy_;
  MapPart part_;               ///< as it was last written
  std::uint64_t first_epoch_;  ///< of the part

  DriveJournal& journal_;
  std::vector<JournalKeyframe> keyframes_;  ///< that the map was made from, those of earlier parts first
  std::vector<PoseEdge> loops_;
  std::size_t earlier_keyframe_count_ = 0, earlier_loop_count_ = 0;
  std::size_t written_keyframe_count_ = 0, written_loop_count_ = 0;  ///< in this file
  bool has_earlier_ = false;                                         ///< the file holds the part that may be continued
  bool found_itself_ = false, recalled_all_ = false, has_taken_over_ = false, let_go_is_due_ = false;
  std::optional<MapFile> file_;
  std::uint64_t log_inode_ = 0;  ///< of map.gpkg-wal, while file_ is open
  std::string set_aside_text_;

  mutable std::mutex report_mutex_;
  StoreReport report_;
};

}  // namespace roadvec
