#include "daemon/store/map_file.h"

#include <gmock/gmock.h>

#include "daemon/store/schema.h"
#include "tests/support/map_story.h"
#include "tests/support/temporary_folder.h"

namespace roadvec {
namespace {

using ::testing::HasSubstr;

class MapFileTest : public ::testing::Test {
 protected:
  MapFile open() const {
    Stored<MapFile> file = MapFile::open(path_);
    if (!file) throw std::runtime_error(file.error().text);
    return std::move(*file);
  }
  [[nodiscard]] Database database() const { return Database::open(path_.string(), Database::Mode::make).value(); }
  static std::set<LineId> ids_of(const VectorMap& map) {
    std::set<LineId> ids;
    for (const auto& [id, line] : map) ids.insert(id);
    return ids;
  }
  static MapStory story_of(int steps) {
    MapStory story(1);
    for (int i = 0; i < steps; ++i) story.step();
    return story;
  }

  TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "map.gpkg";
  MapPart part_{.number = 0, .anchor = {49.0, 8.4, 112.0, -70.98}, .head = {0xFFFF'0000'0000'0001, 12}};
};

TEST_F(MapFileTest, gives_back_what_was_written_to_the_millimetre) {
  const MapStory story = story_of(150);
  MapFile file = open();
  ASSERT_TRUE(file.write(part_, story.map(), ids_of(story.map())));
  const std::vector<MapPart> parts = file.parts().value();
  ASSERT_EQ(parts.size(), 1U);
  EXPECT_EQ(parts[0].number, part_.number);
  EXPECT_EQ(parts[0].head.epoch, part_.head.epoch);
  EXPECT_EQ(parts[0].head.seq, 12U);
  EXPECT_EQ(parts[0].anchor, part_.anchor);
  const VectorMap read = file.lines(parts[0]).value();
  ASSERT_EQ(read.size(), story.map().size());
  for (const auto& [id, line] : story.map()) {
    const MapLine& found = read.at(id);
    EXPECT_EQ(found.attributes, line.attributes);
    EXPECT_EQ(found.revision, line.revision);
    EXPECT_EQ(found.first_seen, line.first_seen);
    EXPECT_EQ(found.last_seen, line.last_seen);
    ASSERT_EQ(found.vertices.size(), line.vertices.size());
    for (std::size_t i = 0; i < line.vertices.size(); ++i) {
      EXPECT_EQ(mm_from_m(found.vertices[i].x_m), mm_from_m(line.vertices[i].x_m));
      EXPECT_EQ(mm_from_m(found.vertices[i].y_m), mm_from_m(line.vertices[i].y_m));
      EXPECT_EQ(mm_from_m(found.vertices[i].z_m), mm_from_m(line.vertices[i].z_m));
    }
  }
}

TEST_F(MapFileTest, a_line_that_went_or_has_one_vertex_left_is_taken_out) {
  MapStory story = story_of(20);
  VectorMap map = story.map();
  MapFile file = open();
  ASSERT_TRUE(file.write(part_, map, ids_of(map)));
  ASSERT_EQ(map.size(), 2U);
  const LineId gone = map.begin()->first, dot = map.rbegin()->first;
  map.erase(gone);
  map.at(dot).vertices.resize(1);
  ASSERT_TRUE(file.write(part_, map, {gone, dot}));
  EXPECT_TRUE(file.lines(part_).value().empty());
}

TEST_F(MapFileTest, every_start_has_a_part_of_its_own) {
  const MapStory story = story_of(20);
  MapPart second = part_;
  ASSERT_TRUE(open().write(part_, story.map(), ids_of(story.map())));
  ASSERT_TRUE(open().write(second, story.map(), ids_of(story.map())));
  EXPECT_EQ(open().parts().value().size(), 2U);
  EXPECT_EQ(database().number("SELECT count(*) FROM boundaries"), 2 * story.map().size());
}

TEST_F(MapFileTest, a_part_that_is_gone_from_the_file_means_that_it_was_replaced) {
  const MapStory story = story_of(20);
  MapFile file = open();
  ASSERT_TRUE(file.write(part_, story.map(), ids_of(story.map())));
  ASSERT_TRUE(database().run("DELETE FROM parts"));
  const Stored<void> written = file.write(part_, story.map(), {});
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().trouble, StoreTrouble::replaced);
}

TEST_F(MapFileTest, a_file_of_an_earlier_schema_is_brought_up_to_date_with_what_it_holds) {
  const MapStory story = story_of(40);
  ASSERT_TRUE(open().write(part_, story.map(), ids_of(story.map())));
  {
    // What version 1 was: nothing of how it came about, no column `finished`.
    const Database old = database();
    ASSERT_TRUE(
        old.run("DROP TABLE x_keyframes; DROP TABLE x_loops; ALTER TABLE parts DROP COLUMN continues;"
                "ALTER TABLE parts DROP COLUMN let_go; ALTER TABLE parts DROP COLUMN finished;"
                "UPDATE x_schema SET version = 1"));
  }
  MapFile file = open();
  EXPECT_EQ(database().number("SELECT version FROM x_schema"), kSchemaVersion);
  ASSERT_EQ(file.parts().value().size(), 1U);
  EXPECT_FALSE(file.parts().value()[0].finished);
  EXPECT_EQ(file.lines(part_).value().size(), story.map().size());
}

TEST_F(MapFileTest, a_file_made_step_by_step_has_the_tables_of_a_new_one) {
  {
    const Database stepwise = database();
    for (std::int64_t version = 1; version <= kSchemaVersion; ++version) ASSERT_TRUE(bring_up_to(stepwise, version));
  }
  const std::string tables = "SELECT group_concat(sql) FROM (SELECT sql FROM sqlite_master ORDER BY name)";
  const std::string grown = database().text(tables).value();
  std::filesystem::remove(path_);
  open();
  EXPECT_EQ(database().text(tables).value(), grown);
  EXPECT_THAT(grown, HasSubstr("finished"));
}

TEST_F(MapFileTest, what_is_not_ours_or_of_a_later_version_is_told_apart_and_left_alone) {
  const auto trouble = [&] { return MapFile::open(path_).error().trouble; };
  ASSERT_TRUE(database().run("CREATE TABLE recipes (name TEXT)"));
  const std::string recipes = bytes_of(path_);
  EXPECT_EQ(trouble(), StoreTrouble::foreign);
  EXPECT_EQ(bytes_of(path_), recipes);
  ASSERT_TRUE(database().run("PRAGMA application_id = 1196444487"));
  EXPECT_EQ(trouble(), StoreTrouble::foreign);

  std::filesystem::remove(path_);
  open();
  ASSERT_TRUE(database().run("UPDATE x_schema SET version = 99"));
  const Stored<MapFile> newer = MapFile::open(path_);
  EXPECT_EQ(newer.error().trouble, StoreTrouble::newer);
  EXPECT_THAT(newer.error().text, HasSubstr("99"));
  EXPECT_EQ(MapFile::open_to_read(path_).error().trouble, StoreTrouble::newer);

  std::ofstream(path_) << std::string(20'000, 'x');
  EXPECT_EQ(trouble(), StoreTrouble::damaged);
}

TEST_F(MapFileTest, the_log_goes_into_the_file_now_and_then) {
  VectorMap map;
  MapLine& line = map[1];
  line.id = 1;
  for (int i = 0; i < 40'000; ++i) line.vertices.push_back({0.025 * i, 0.0});
  MapFile file = open();
  std::uintmax_t most_bytes = 0;
  for (int batch = 0; batch < 12; ++batch) {  // of a megabyte
    for (Vertex& vertex : line.vertices) vertex.y_m += 0.5;
    ASSERT_TRUE(file.write(part_, map, {1}));
    most_bytes = std::max(most_bytes, std::filesystem::file_size(path_.string() + "-wal"));
  }
  EXPECT_GT(most_bytes, std::uintmax_t{3} << 20);
  EXPECT_LT(most_bytes, std::uintmax_t{6} << 20);
  EXPECT_EQ(file.lines(part_).value().at(1).vertices.size(), line.vertices.size());
}

TEST_F(MapFileTest, the_log_is_asserted_anew_when_another_program_has_left_it) {
  ASSERT_TRUE(open().leave_wal());
  EXPECT_EQ(database().text("PRAGMA journal_mode"), "delete");
  open();
  EXPECT_EQ(database().text("PRAGMA journal_mode"), "wal");
}

}  // namespace
}  // namespace roadvec
