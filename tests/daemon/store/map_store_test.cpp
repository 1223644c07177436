#include "daemon/store/map_store.h"

#include <gmock/gmock.h>

#include <thread>

#include "tests/daemon/store/map_store_fixture.h"

namespace roadvec {
namespace {

using ::testing::HasSubstr;

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
  const std::size_t line_count = story_.map().size();
  begin_anew();
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
  begin_anew();
  wait_until_all_is_kept();
  stop();
  EXPECT_EQ(store_->report().durable_seq, 1U);
  EXPECT_TRUE(MapFile::open_to_read(path_)->parts().value().empty());
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
