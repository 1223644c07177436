#include "daemon/store/map_store.h"

#include <gmock/gmock.h>

#include <thread>

#include "core/base/angle.h"
#include "tests/support/map_story.h"
#include "tests/support/temporary_folder.h"

namespace roadvec {
namespace {

using ::testing::HasSubstr;

constexpr MapHead kFirst{0xFEED'0000, 0};
constexpr std::chrono::seconds kLongest{20};

/// A store in a thread of its own, and a story published by the test's thread.
class MapStoreTest : public ::testing::Test {
 protected:
  ~MapStoreTest() override { stop(); }

  void start() {
    store_ = std::make_unique<MapStore>(MapStoreConfig{.directory = directory_,
                                                       .batch_interval = std::chrono::milliseconds(20),
                                                       .last_tries = last_tries_,
                                                       .start = kFirst,
                                                       .anchor = {49.0, 8.4, 112.0, 0.0},
                                                       .earlier = earlier_},
                                        log_, journal_);
    thread_ = std::jthread([this](const std::stop_token& token) { followed_to_the_end_ = store_->run(token); });
  }
  void stop() {
    if (!thread_.joinable()) return;
    thread_.request_stop();
    thread_.join();
  }
  void publish(int steps) {
    for (int i = 0; i < steps; ++i) publisher_.publish(story_.step(), story_.map(), [](std::size_t) {});
  }
  void wait_until(const char* what, const std::function<bool(const StoreReport&)>& happened) const {
    const auto end = std::chrono::steady_clock::now() + kLongest;
    while (!happened(store_->report())) {
      ASSERT_LT(std::chrono::steady_clock::now(), end) << what << ": " << store_->report().detail;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }
  void wait_until_all_is_kept() const {
    wait_until("durable",
               [&](const StoreReport& r) { return r.durable_seq == publisher_.head().seq && !r.in_trouble; });
  }
  void wait_for_trouble(const std::string& words) const {
    wait_until(words.c_str(),
               [&](const StoreReport& r) { return r.in_trouble && r.detail.find(words) != std::string::npos; });
  }
  /// The newest part that the file holds is the story's map.
  void expect_kept(std::size_t part_count) const {
    const Stored<MapFile> file = MapFile::open_to_read(path_);
    ASSERT_TRUE(file) << file.error().text;
    const std::vector<MapPart> parts = file->parts().value();
    ASSERT_EQ(parts.size(), part_count);
    EXPECT_EQ(parts.back().head.seq, publisher_.head().seq);
    EXPECT_EQ(parts.back().head.epoch, publisher_.head().epoch);
    const VectorMap kept = file->lines(parts.back()).value();
    ASSERT_EQ(kept.size(), story_.map().size());
    for (const auto& [id, line] : story_.map()) {
      ASSERT_TRUE(kept.contains(id));
      EXPECT_EQ(kept.at(id).revision, line.revision);
      EXPECT_EQ(kept.at(id).vertices.size(), line.vertices.size());
    }
  }

  TemporaryFolder folder_;
  const std::filesystem::path directory_ = folder_ / "state", path_ = directory_ / "map.gpkg";
  std::chrono::milliseconds last_tries_{5000};
  FrameLog log_{std::size_t{16} << 20};
  DriveJournal journal_;
  std::optional<EarlierPart> earlier_;
  MapPublisher publisher_{log_, kFirst};
  MapStory story_{1};
  std::unique_ptr<MapStore> store_;
  bool followed_to_the_end_ = false;
  std::jthread thread_;
};

TEST_F(MapStoreTest, keeps_the_map_while_it_grows_and_says_how_far_it_has_come) {
  start();
  for (int i = 0; i < 5; ++i) {
    publish(30);
    wait_until_all_is_kept();
    expect_kept(1);
  }
  stop();
  EXPECT_TRUE(followed_to_the_end_);
  EXPECT_EQ(store_->report().state, "ok");
}

TEST_F(MapStoreTest, writes_the_rest_when_it_is_stopped_and_leaves_one_file) {
  start();
  publish(100);
  stop();
  expect_kept(1);
  EXPECT_TRUE(MapFile::open_to_read(path_)->parts().value()[0].finished);
  EXPECT_EQ(store_->report().durable_seq, publisher_.head().seq);
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(directory_)) names.insert(entry.path().filename());
  EXPECT_EQ(names, std::set<std::string>{"map.gpkg"});
}

TEST_F(MapStoreTest, a_map_that_is_begun_anew_leaves_the_one_before_in_the_file) {
  start();
  publish(60);
  MapChange anew;
  anew.begins_anew = true;
  for (const auto& [id, line] : story_.map()) anew.removed.push_back(id);
  const std::size_t line_count = story_.map().size();
  journal_.begin_new_map();
  publisher_.publish(anew, {}, [](std::size_t) {});
  story_ = MapStory{2};
  publish(30);
  wait_until_all_is_kept();
  expect_kept(2);
  stop();
  expect_kept(2);
  const Stored<MapFile> file = MapFile::open_to_read(path_);
  const MapPart before = file->parts().value()[0];
  EXPECT_TRUE(before.finished);
  EXPECT_EQ(before.head.epoch, kFirst.epoch);
  EXPECT_EQ(file->lines(before)->size(), line_count);
}

TEST_F(MapStoreTest, an_empty_map_that_is_begun_anew_is_kept_as_it_is_without_a_part) {
  start();
  MapChange anew;
  anew.begins_anew = true;
  journal_.begin_new_map();
  publisher_.publish(anew, {}, [](std::size_t) {});
  wait_until_all_is_kept();
  stop();
  EXPECT_EQ(store_->report().durable_seq, 1U);
  EXPECT_TRUE(MapFile::open_to_read(path_)->parts().value().empty());
}

JournalNews news_of(std::size_t first, std::size_t count) {
  JournalNews news;
  LineSet lines;
  lines.begin_line({.kind = BoundaryKind::curb, .height_m = 0.1F});
  lines.push_vertex({1, 2});
  lines.push_vertex({3, 2});
  for (std::size_t k = first; k < first + count; ++k) {
    const auto at_m = 2.0 * static_cast<double>(k);
    const std::size_t before = k == 0 ? 0 : k - 1;
    news.keyframes.push_back(
        {{SensorTime{static_cast<std::int64_t>(k)}, {}, PackedLines(lines), PackedLines(LineSet{})},
         {before, k, {2, 0, 0}, Eigen::Matrix3d::Identity()},
         at_m,
         {at_m, 0, 0}});
  }
  return news;
}

TEST_F(MapStoreTest, a_later_start_goes_on_with_what_the_map_was_made_from) {
  const Anchor here{49.0, 8.4, 112.0, 10.0};
  constexpr std::chrono::seconds kLong{3600}, kShort{5};
  JournalNews news = news_of(0, 20);
  news.loops.push_back({3, 15, {0, 1, 0}, Eigen::Matrix3d::Identity()});
  start();
  journal_.note(std::move(news));
  publish(60);
  stop();
  const std::size_t first_line_count = story_.map().size();

  const auto found = find_earlier_part(path_, here, kLong);
  ASSERT_TRUE(found) << found.error().text;
  ASSERT_TRUE(*found);
  const Recollection& drive = (*found)->drive;
  ASSERT_EQ(drive.keyframes.size(), 20U);
  EXPECT_EQ(drive.keyframes[7].time, SensorTime{7});
  EXPECT_EQ(drive.graph.odometry[7].to, 8U);
  EXPECT_EQ(drive.graph.odometry[7].T_from_to, (Pose2{2, 0, 0}));
  ASSERT_EQ(drive.graph.loops.size(), 1U);
  EXPECT_EQ(drive.graph.loops[0].edge.to, 15U);
  ASSERT_EQ(drive.guesses.size(), 2U);
  EXPECT_NEAR(drive.guesses[0].T_map_odom.x_m, 0, 1e-6);
  EXPECT_NEAR(drive.guesses[0].T_map_odom.theta_rad, rad_from_deg(10), 1e-9);
  EXPECT_NEAR(drive.guesses[1].T_map_odom.x_m, 48, 1e-6);
  EXPECT_NEAR((*find_earlier_part(path_, here, kShort))->drive.guesses[0].T_map_odom.x_m, 48, 1e-6);
  EXPECT_FALSE(*find_earlier_part(path_, {49.01, 8.4, 112.0, 0.0}, kLong));  // a kilometre away
  EXPECT_FALSE(*find_earlier_part(folder_ / "none.gpkg", here, kLong));

  // The second start is a part of its own, with the first one's lines in the file, until it has found itself.
  earlier_ = **found;
  const MapHead second{0xBEEF'0000, 0};
  story_ = MapStory{2};
  FrameLog log(std::size_t{16} << 20);
  MapPublisher publisher(log, second);
  DriveJournal journal;
  MapStore store({.directory = directory_,
                  .batch_interval = std::chrono::milliseconds(20),
                  .start = second,
                  .anchor = here,
                  .earlier = earlier_},
                 log, journal);
  std::jthread thread([&](const std::stop_token& token) { EXPECT_TRUE(store.run(token)); });
  const auto step = [&](JournalNews noted) {
    journal.note(std::move(noted));
    for (int i = 0; i < 20; ++i) publisher.publish(story_.step(), story_.map(), [](std::size_t) {});
    const auto end = std::chrono::steady_clock::now() + kLongest;
    while (store.report().durable_seq != publisher.head().seq) {
      ASSERT_LT(std::chrono::steady_clock::now(), end) << store.report().state;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  };
  const auto parts = [&] { return MapFile::open_to_read(path_)->parts().value(); };
  const auto line_count = [&](std::size_t part) { return MapFile::open_to_read(path_)->lines(parts()[part])->size(); };
  step(news_of(20, 3));
  ASSERT_EQ(parts().size(), 2U);
  EXPECT_EQ(parts()[1].continues, 0);
  EXPECT_EQ(MapFile::open_to_read(path_)->drive(parts()[1])->keyframes.size(), 3U);
  EXPECT_EQ((*find_earlier_part(path_, here, kLong))->part.number, parts()[0].number);  // the longer one
  JournalNews where = news_of(23, 1);
  where.found_itself = true;
  where.loops.push_back({4, 23, {0, 1, 0}, Eigen::Matrix3d::Identity()});
  step(std::move(where));
  EXPECT_EQ(parts()[1].continues, parts()[0].number);
  EXPECT_EQ(line_count(0), first_line_count);
  step({.keyframes = {}, .loops = {}, .found_itself = true, .recalled_all = true});
  step(news_of(24, 1));
  thread.request_stop();
  thread.join();
  EXPECT_EQ(line_count(0), 0U);
  EXPECT_EQ(line_count(1), story_.map().size());
  const auto third = find_earlier_part(path_, here, kLong);
  EXPECT_EQ((*third)->part.number, parts()[1].number);
  EXPECT_EQ((*third)->drive.keyframes.size(), 25U);
  EXPECT_EQ((*third)->drive.graph.loops.size(), 2U);
}

TEST_F(MapStoreTest, a_new_file_in_the_place_of_the_one_it_goes_on_with_gets_all_of_it) {
  start();
  journal_.note(news_of(0, 20));
  publish(60);
  stop();
  earlier_ = **find_earlier_part(path_, {49.0, 8.4, 112.0, 0.0}, std::chrono::seconds(5));
  std::filesystem::remove(path_);
  FrameLog log(std::size_t{16} << 20);
  MapPublisher publisher(log, {0xBEEF'0000, 0});
  DriveJournal journal;
  JournalNews news = news_of(20, 5);
  news.found_itself = news.recalled_all = true;
  journal.note(std::move(news));
  MapStore store({.directory = directory_,
                  .batch_interval = std::chrono::milliseconds(20),
                  .start = {0xBEEF'0000, 0},
                  .anchor = {49.0, 8.4, 112.0, 0.0},
                  .earlier = earlier_},
                 log, journal);
  story_ = MapStory{2};
  for (int i = 0; i < 20; ++i) publisher.publish(story_.step(), story_.map(), [](std::size_t) {});
  std::stop_source stopped;
  stopped.request_stop();
  EXPECT_TRUE(store.run(stopped.get_token()));
  const Stored<MapFile> file = MapFile::open_to_read(path_);
  ASSERT_EQ(file->parts()->size(), 1U);
  EXPECT_EQ(file->parts()->front().continues, 0);
  EXPECT_EQ(file->drive(file->parts()->front())->keyframes.size(), 25U);
}

TEST_F(MapStoreTest, after_a_new_map_no_start_goes_on_with_those_before) {
  start();
  journal_.note(news_of(0, 20));
  publish(60);
  MapChange anew;
  anew.begins_anew = true;
  for (const auto& [id, line] : story_.map()) anew.removed.push_back(id);
  journal_.begin_new_map();
  publisher_.publish(anew, {}, [](std::size_t) {});
  story_ = MapStory{2};
  const auto found = [&] {
    return find_earlier_part(path_, {49.0, 8.4, 112.0, 0.0}, std::chrono::seconds(3600)).value();
  };
  stop();
  EXPECT_FALSE(found());
}

TEST_F(MapStoreTest, a_keyframe_that_cannot_be_read_is_said_and_not_gone_on_with) {
  start();
  journal_.note(news_of(0, 20));
  publish(60);
  stop();
  const auto sees = [&](const std::string& sql) {
    EXPECT_TRUE(Database::open(path_.string(), Database::Mode::make)->run(sql));
    return find_earlier_part(path_, {49.0, 8.4, 112.0, 0.0}, std::chrono::seconds(3600)).error().text;
  };
  EXPECT_THAT(sees("UPDATE x_keyframes SET lvm = x'0102' WHERE keyframe = 7"), HasSubstr("keyframe 7"));
  EXPECT_THAT(sees("DELETE FROM x_keyframes WHERE keyframe = 5"), HasSubstr("keyframe 5"));
  EXPECT_THAT(sees("UPDATE x_keyframes SET step = zeroblob(95) WHERE keyframe = 3"), HasSubstr("keyframe 3"));
}

TEST_F(MapStoreTest, waits_while_another_program_holds_a_lock) {
  start();
  publish(30);
  wait_until_all_is_kept();
  {
    const Database other = Database::open(path_.string(), Database::Mode::make).value();
    ASSERT_TRUE(other.run("BEGIN IMMEDIATE"));
    publish(10);
    wait_for_trouble("locked by another program");
    EXPECT_LT(store_->report().durable_seq, publisher_.head().seq);
    EXPECT_GT(store_->report().durable_seq, 0U);
  }
  wait_until_all_is_kept();
  expect_kept(1);
}

TEST_F(MapStoreTest, goes_on_beside_a_reader_that_stays) {
  start();
  publish(30);
  wait_until_all_is_kept();
  const Database reader = Database::open(path_.string(), Database::Mode::read).value();
  ASSERT_TRUE(reader.run("BEGIN; SELECT count(*) FROM boundaries"));
  const std::int64_t before = reader.number("SELECT sum(revision) FROM boundaries").value();
  publish(100);
  wait_until_all_is_kept();
  EXPECT_EQ(reader.number("SELECT sum(revision) FROM boundaries"), before) << "the reader's own moment";
  stop();
  expect_kept(1);
}

TEST_F(MapStoreTest, a_reader_that_keeps_the_log_from_being_asserted_is_waited_for) {
  std::filesystem::create_directories(directory_);
  ASSERT_TRUE(MapFile::open(path_)->leave_wal());
  {
    const Database reader = Database::open(path_.string(), Database::Mode::read).value();
    ASSERT_TRUE(reader.run("BEGIN; SELECT count(*) FROM parts"));
    start();
    publish(30);
    wait_for_trouble("locked by another program");
  }
  wait_until_all_is_kept();
  expect_kept(1);
}

TEST_F(MapStoreTest, a_file_that_is_taken_away_is_written_anew) {
  start();
  publish(60);
  wait_until_all_is_kept();
  std::filesystem::rename(path_, folder_ / "taken.gpkg");
  wait_until("opened again", [](const StoreReport& r) { return r.opened_count == 2; });
  publish(10);
  wait_until_all_is_kept();
  expect_kept(1);
}

TEST_F(MapStoreTest, a_file_put_in_its_place_gets_the_map_as_a_part_and_keeps_its_own) {
  start();
  publish(60);
  wait_until_all_is_kept();
  MapPart other{.number = 0, .anchor = {50, 9, 0, 0}, .head = {1, 1}};
  VectorMap line;
  line[9].id = 9;
  line[9].vertices = {{0, 0}, {1, 0}};
  {
    MapFile backup = MapFile::open(folder_ / "backup.gpkg").value();
    ASSERT_TRUE(backup.write(other, line, {9}));
    ASSERT_TRUE(backup.leave_wal());
  }
  std::filesystem::rename(folder_ / "backup.gpkg", path_);
  wait_until("opened again", [](const StoreReport& r) { return r.opened_count == 2; });
  wait_until_all_is_kept();
  expect_kept(2);
  EXPECT_EQ(MapFile::open_to_read(path_)->lines(other).value().size(), 1U);
}

TEST_F(MapStoreTest, a_file_copied_over_the_open_one_is_noticed_and_keeps_what_it_brings) {
  start();
  publish(60);
  wait_until_all_is_kept();
  MapPart other{.number = 0, .anchor = {50, 9, 0, 0}, .head = {1, 1}};
  VectorMap lines;
  for (LineId id = 1; id <= 300; ++id) {
    lines[id].id = id;
    lines[id].vertices = {{0, 0}, {1, 0}};
  }
  {
    MapFile backup = MapFile::open(folder_ / "backup.gpkg").value();
    std::set<LineId> ids;
    for (const auto& [id, line] : lines) ids.insert(id);
    ASSERT_TRUE(backup.write(other, lines, ids));
    ASSERT_TRUE(backup.leave_wal());
  }
  std::ofstream(path_, std::ios::binary) << bytes_of(folder_ / "backup.gpkg");
  wait_until("opened again", [](const StoreReport& r) { return r.opened_count == 2; });
  publish(10);
  wait_until_all_is_kept();
  expect_kept(2);
  EXPECT_EQ(MapFile::open_to_read(path_)->lines(other).value().size(), 300U);
}

TEST_F(MapStoreTest, a_file_cut_to_nothing_is_written_anew) {
  start();
  publish(60);
  wait_until_all_is_kept();
  std::filesystem::resize_file(path_, 0);
  wait_until("opened again", [](const StoreReport& r) { return r.opened_count == 2; });
  wait_until_all_is_kept();
  expect_kept(1);
}

TEST_F(MapStoreTest, a_damaged_file_is_set_aside_with_its_bytes_and_named) {
  std::filesystem::create_directories(directory_);
  const std::string rubbish(20'000, 'x');
  std::ofstream(path_) << rubbish;
  start();
  publish(30);
  wait_until_all_is_kept();
  expect_kept(1);
  EXPECT_EQ(store_->report().set_aside_count, 1U);
  EXPECT_EQ(store_->report().state, "ok");
  EXPECT_THAT(store_->report().detail, HasSubstr("map-damaged-20"));
  std::size_t found = 0;
  for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
    if (!entry.path().filename().string().starts_with("map-damaged-")) continue;
    ++found;
    EXPECT_EQ(bytes_of(entry.path()), rubbish);
  }
  EXPECT_EQ(found, 1U);
}

TEST_F(MapStoreTest, a_file_in_the_place_of_the_directory_is_waited_for) {
  std::ofstream(directory_.string()) << "not a directory";
  start();
  publish(30);
  wait_for_trouble("cannot be written");
  std::filesystem::remove(directory_);
  wait_until_all_is_kept();
  expect_kept(1);
}

TEST_F(MapStoreTest, when_it_cannot_write_to_the_end_it_ends_and_says_what_is_missing) {
  last_tries_ = std::chrono::milliseconds(50);
  std::ofstream(directory_.string()) << "not a directory";
  start();
  publish(30);
  stop();
  EXPECT_TRUE(followed_to_the_end_);
  EXPECT_TRUE(store_->report().in_trouble);
  EXPECT_LT(store_->report().durable_seq, publisher_.head().seq);
}

TEST_F(MapStoreTest, tables_that_another_program_drops_are_made_again_and_the_file_kept) {
  start();
  publish(30);
  wait_until_all_is_kept();
  ASSERT_TRUE(Database::open(path_.string(), Database::Mode::make)->run("DROP TABLE boundaries"));
  publish(5);
  wait_until("set aside", [](const StoreReport& r) { return r.set_aside_count == 1; });
  wait_until_all_is_kept();
  expect_kept(1);
}

}  // namespace
}  // namespace roadvec
