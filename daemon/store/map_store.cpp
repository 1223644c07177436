#include "daemon/store/map_store.h"

#include <poll.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <ctime>
#include <iterator>
#include <system_error>

#include "core/base/ensure.h"

namespace roadvec {
namespace {

constexpr std::chrono::milliseconds kTurn{100};
constexpr std::uintmax_t kNoRoomBytes = 256 << 10;

std::filesystem::path beside(const std::filesystem::path& path, const char* suffix) { return path.string() + suffix; }

std::uint64_t inode_of(const std::filesystem::path& path) {
  struct stat facts {};
  return ::stat(path.c_str(), &facts) == 0 ? facts.st_ino : 0;
}

double bytes_in(const std::filesystem::path& path) {
  std::error_code error;
  const std::uintmax_t bytes = std::filesystem::file_size(path, error);
  return error ? 0 : static_cast<double>(bytes);
}

std::string utc_for_names() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  const std::size_t length = std::strftime(text.data(), text.size(), "%Y%m%dT%H%M%SZ", &utc);
  return {text.data(), length};
}

const char* reason_of(StoreTrouble trouble) {
  return trouble == StoreTrouble::damaged ? "damaged" : trouble == StoreTrouble::newer ? "newer" : "foreign";
}

bool is_beyond_use(StoreTrouble trouble) {
  return trouble == StoreTrouble::damaged || trouble == StoreTrouble::foreign || trouble == StoreTrouble::newer;
}

const char* name_of(StoreTrouble trouble) {
  switch (trouble) {
    case StoreTrouble::full:
      return "full";
    case StoreTrouble::locked:
      return "locked";
    case StoreTrouble::replaced:
      return "replaced";
    default:
      return "unwritable";
  }
}

const char* words_for(StoreTrouble trouble) {
  switch (trouble) {
    case StoreTrouble::full:
      return "disk full: make room";
    case StoreTrouble::locked:
      return "locked by another program: close it";
    case StoreTrouble::replaced:
      return "moved, removed or replaced";
    default:
      return "cannot be written";
  }
}

}  // namespace

MapStore::MapStore(const MapStoreConfig& config, FrameLog& log, DriveJournal& journal)
    : config_(config),
      path_(config.directory / "map.gpkg"),
      reader_(log),
      copy_(config.start),
      first_epoch_(config.start.epoch),
      journal_(journal) {
  part_.anchor = config.anchor;
  if (config.earlier) {
    const Recollection& drive = config.earlier->drive;
    const PoseGraph& graph = drive.graph;
    for (std::size_t k = 0; k < drive.keyframes.size(); ++k) {
      keyframes_.push_back({k, drive.keyframes[k], k == 0 ? PoseEdge{} : graph.odometry[k - 1], graph.travelled_m[k],
                            graph.poses_map[k]});
    }
    for (const LoopEdge& loop : graph.loops) loops_.push_back(loop.edge);
    earlier_keyframe_count_ = keyframes_.size();
    earlier_loop_count_ = loops_.size();
    config_.earlier->drive = {};
  }
  report_.detail = "opening " + path_.string();
}

StoreReport MapStore::report() const {
  const std::scoped_lock lock(report_mutex_);
  return report_;
}

bool MapStore::run(const std::stop_token& stop) {
  Clock::time_point next = Clock::now();
  while (!stop.stop_requested()) {
    pollfd bell{reader_.doorbell(), POLLIN, 0};
    ::poll(&bell, 1, static_cast<int>(kTurn.count()));
    if (!take_new()) return false;
    if (Clock::now() < next) continue;
    take(journal_.take());
    if (!file_) open();
    if (file_) write(false);
    next = Clock::now() + std::chrono::duration_cast<Clock::duration>(config_.batch_interval);
  }
  if (!take_new()) return false;
  take(journal_.take());
  finish();
  return true;
}

bool MapStore::take_new() {
  reader_.clear_doorbell();
  for (;;) {
    switch (reader_.next(frame_)) {
      case FrameLog::Outcome::nothing_new:
        return true;
      case FrameLog::Outcome::overrun:
        return false;
      case FrameLog::Outcome::frame:
        if (!copy_.take(frame_)) return false;
        if (copy_.begins_anew()) begin_part();
    }
  }
}

void MapStore::take(JournalNews news) {
  for (JournalKeyframe& keyframe : news.keyframes) {
    const std::size_t number = keyframe.number;
    ENSURE(number <= keyframes_.size());
    if (number == keyframes_.size()) keyframes_.emplace_back();
    keyframes_[number] = std::move(keyframe);
    written_keyframe_count_ = std::min(written_keyframe_count_, number);
  }
  std::ranges::move(news.loops, std::back_inserter(loops_));
  found_itself_ = found_itself_ || news.found_itself;
  recalled_all_ = recalled_all_ || news.recalled_all;
}

/// The map before stays in the file as a part of its own; what of it cannot be written by now is forgotten with it.
void MapStore::begin_part() {
  take(journal_.take_last());
  if (!file_) open();
  if (file_) write(true);
  copy_.let_go();
  config_.earlier.reset();
  keyframes_.clear();
  loops_.clear();
  earlier_keyframe_count_ = earlier_loop_count_ = written_keyframe_count_ = written_loop_count_ = 0;
  has_earlier_ = found_itself_ = recalled_all_ = has_taken_over_ = false;
  let_go_is_due_ = true;
  part_ = {};
  part_.anchor = config_.anchor;
  first_epoch_ = copy_.head().epoch;
}

void MapStore::open() {
  std::error_code error;
  std::filesystem::create_directories(config_.directory, error);
  Stored<MapFile> file = MapFile::open(path_);
  if (!file && is_beyond_use(file.error().trouble)) {
    set_aside(file.error());
    file = MapFile::open(path_);
  }
  if (!file) return meet(file.error());
  if (const Stored<void> found = find_part(*file); !found) return meet(found.error());
  file_.emplace(std::move(*file));
  log_inode_ = inode_of(beside(path_, "-wal"));
  const std::scoped_lock lock(report_mutex_);
  ++report_.opened_count;
  report_.durable_seq = part_.head.seq;
}

/// Our part, if an earlier opening has written one into this very file: it goes on. Either way every line is written
/// again, and what the file has beyond that is taken out.
Stored<void> MapStore::find_part(const MapFile& file) {
  const Stored<std::vector<MapPart>> parts = file.parts();
  if (!parts) return tl::unexpected<StoreError>(parts.error());
  part_.number = 0;
  part_.head = {};
  has_earlier_ = has_taken_over_ = false;
  for (const MapPart& part : *parts) {
    // The same file, unless another was put in its place since the start.
    has_earlier_ = has_earlier_ || (config_.earlier && part.number == config_.earlier->part.number &&
                                    part.head.epoch == config_.earlier->part.head.epoch);
    // Epochs begin at random and count up with each closed loop.
    if (first_epoch_ <= part.head.epoch && part.head.epoch <= copy_.head().epoch) part_ = part;
  }
  written_keyframe_count_ = has_earlier_ ? earlier_keyframe_count_ : 0;
  written_loop_count_ = has_earlier_ ? earlier_loop_count_ : 0;
  copy_.all_changed();
  if (part_.number == 0) return {};
  const Stored<VectorMap> written = file.lines(part_);
  if (!written) return tl::unexpected<StoreError>(written.error());
  for (const auto& [id, line] : *written) copy_.changed(id);
  return {};
}

bool MapStore::has_news(bool finished) const {
  return !copy_.changed().empty() || part_.head.seq != copy_.head().seq || finished != part_.finished ||
         written_keyframe_count_ != keyframes_.size() || written_loop_count_ != loops_.size();
}

void MapStore::write(bool finished) {
  settle_earlier_parts();
  if (nothing_to_keep() || !has_news(finished)) {
    if (const Stored<void> unchanged = file_->find_unchanged(); !unchanged) return meet(unchanged.error());
    copy_.written();
    {
      const std::scoped_lock lock(report_mutex_);
      report_.durable_seq = copy_.head().seq;
    }
    return say("ok", {});
  }
  const Clock::time_point begin = Clock::now();
  MapPart part = part_;
  part.head = copy_.head();
  part.finished = finished;
  part.continues = found_itself_ && has_earlier_ ? config_.earlier->part.number : 0;
  const DriveRows drive{.keyframes = std::span(keyframes_).subspan(written_keyframe_count_),
                        .loops = std::span(loops_).subspan(written_loop_count_)};
  const Stored<void> written = file_->write(part, copy_.map(), copy_.changed(), drive);
  if (!written) return meet(written.error());
  part_ = part;
  written_keyframe_count_ = keyframes_.size();
  written_loop_count_ = loops_.size();
  copy_.written();
  count_batch(begin);
  say("ok", {});
}

/// Their lines go when all of them are in this part; a new map at its owner's wish is not continued from them. What
/// fails here has its turn again with the next batch.
void MapStore::settle_earlier_parts() {
  if (let_go_is_due_) let_go_is_due_ = !file_->let_go(part_.number);
  const bool all_written = part_.continues != 0 && recalled_all_ && copy_.changed().empty();
  if (all_written && !has_taken_over_) has_taken_over_ = file_->take_over(part_).has_value();
}

void MapStore::finish() {
  const Clock::time_point end = Clock::now() + config_.last_tries;
  for (;;) {
    if (!file_) open();
    if (file_) write(true);
    if (file_) settle_earlier_parts();
    if (part_.finished || (file_ && nothing_to_keep()) || Clock::now() > end) break;
    ::poll(nullptr, 0, static_cast<int>(kTurn.count()));
  }
  // Who still reads keeps the log; then it stays beside the file, and SQLite finds it there.
  if (file_) static_cast<void>(file_->leave_wal());
  file_.reset();
}

/// Our log stays behind under the name of the file that is there now, and SQLite would take it for that one's. It
/// holds nothing but the part that is written again.
void MapStore::close_moved() {
  file_.reset();
  const bool is_ours = log_inode_ != 0 && inode_of(beside(path_, "-wal")) == log_inode_;
  std::error_code error;
  for (const char* suffix : {"-wal", "-shm"}) {
    if (is_ours) std::filesystem::remove(beside(path_, suffix), error);
  }
}

void MapStore::set_aside(const StoreError& error) {
  file_.reset();
  const std::string stem = "map-" + std::string(reason_of(error.trouble)) + "-" + utc_for_names();
  std::filesystem::path target = config_.directory / (stem + ".gpkg");
  for (int i = 2; std::filesystem::exists(target); ++i) {
    target = config_.directory / (stem + "-" + std::to_string(i) + ".gpkg");
  }
  std::error_code failed;
  std::filesystem::rename(path_, target, failed);
  if (failed) return;  // opening it again says so
  for (const char* suffix : {"-wal", "-shm"}) {
    std::error_code missing;
    std::filesystem::rename(beside(path_, suffix), beside(target, suffix), missing);
  }
  set_aside_text_ = target.string() + " set aside: " + error.text;
  const std::scoped_lock lock(report_mutex_);
  ++report_.set_aside_count;
}

void MapStore::meet(const StoreError& error) {
  StoreTrouble trouble = error.trouble;
  std::error_code unknown;
  const std::filesystem::space_info space = std::filesystem::space(config_.directory, unknown);
  // Not every write that finds no room is told apart from a broken disk.
  if (trouble == StoreTrouble::unwritable && !unknown && space.available < kNoRoomBytes) trouble = StoreTrouble::full;
  {
    const std::scoped_lock lock(report_mutex_);
    ++report_.failed_count;
    // What was on the disk no longer is.
    if (trouble == StoreTrouble::replaced || is_beyond_use(trouble)) report_.durable_seq = 0;
  }
  if (trouble == StoreTrouble::replaced) close_moved();
  if (is_beyond_use(trouble) && file_) set_aside(error);
  if (trouble == StoreTrouble::unwritable) file_.reset();
  say(name_of(trouble), path_.string() + " " + words_for(trouble) + " (" + error.text + ")");
}

void MapStore::count_batch(Clock::time_point begin) {
  const double took_ms = std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
  const double file_bytes = bytes_in(path_), log_bytes = bytes_in(beside(path_, "-wal"));
  const std::scoped_lock lock(report_mutex_);
  ++report_.batch_count;
  report_.durable_seq = part_.head.seq;
  report_.longest_batch_ms = std::max(report_.longest_batch_ms, took_ms);
  report_.file_bytes = file_bytes;
  report_.log_bytes = log_bytes;
}

void MapStore::say(const char* state, const std::string& trouble) {
  const std::scoped_lock lock(report_mutex_);
  report_.unwritten_line_count = copy_.changed().size();
  report_.in_trouble = !trouble.empty();
  report_.state = state;
  report_.detail = trouble;
  if (!set_aside_text_.empty()) report_.detail += (trouble.empty() ? "" : "; ") + set_aside_text_;
}

}  // namespace roadvec
