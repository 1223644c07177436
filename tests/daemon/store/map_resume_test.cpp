#include <gmock/gmock.h>

#include "core/base/angle.h"
#include "tests/daemon/store/map_store_fixture.h"

namespace roadvec {
namespace {

using ::testing::HasSubstr;

constexpr Anchor kHere{49.0, 8.4, 112.0, 10.0};
constexpr std::chrono::seconds kLong{3600}, kShort{5};

/// Keyframes 2 m apart along x.
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
        {k,
         {SensorTime{static_cast<std::int64_t>(k)}, {}, PackedLines(lines), PackedLines(LineSet{})},
         {before, k, {2, 0, 0}, Eigen::Matrix3d::Identity()},
         at_m,
         {at_m, 0, 0}});
  }
  return news;
}

/// A first start, which has ended, and what a later one makes of its file.
class MapResumeTest : public MapStoreTest {
 protected:
  void first_start() {
    start();
    JournalNews news = news_of(0, 20);
    news.loops.push_back({3, 15, {0, 1, 0}, Eigen::Matrix3d::Identity()});
    journal_.note(std::move(news));
    publish(60);
    stop();
  }
  [[nodiscard]] std::optional<EarlierPart> earlier(std::chrono::seconds pause = kLong,
                                                   const Anchor& start = kHere) const {
    const auto found = find_earlier_part(path_, start, pause);
    EXPECT_TRUE(found) << found.error().text;
    return found.value_or(std::nullopt);
  }
  [[nodiscard]] std::vector<MapPart> parts() const { return MapFile::open_to_read(path_)->parts().value(); }
  [[nodiscard]] std::size_t line_count(const MapPart& part) const {
    return MapFile::open_to_read(path_)->lines(part)->size();
  }
  [[nodiscard]] Recollection drive(const MapPart& part) const {
    return MapFile::open_to_read(path_)->drive(part).value();
  }
};

/// Goes on with a part, or says why not.
class SecondStart {
 public:
  SecondStart(const std::filesystem::path& directory, const EarlierPart& earlier)
      : store_({.directory = directory,
                .batch_interval = std::chrono::milliseconds(20),
                .start = kHead,
                .anchor = kHere,
                .earlier = earlier},
               log_, journal_),
        thread_([this](const std::stop_token& token) { EXPECT_TRUE(store_.run(token)); }) {}

  /// Some changes of the map, and what they were made from; until all of it is on the disk.
  void step(JournalNews noted) {
    journal_.note(std::move(noted));
    for (int i = 0; i < 20; ++i) publisher_.publish(story_.step(), story_.map(), [](std::size_t) {});
    const auto end = std::chrono::steady_clock::now() + kLongest;
    while (store_.report().durable_seq != publisher_.head().seq) {
      ASSERT_LT(std::chrono::steady_clock::now(), end) << store_.report().detail;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }
  void stop() {
    thread_.request_stop();
    thread_.join();
  }
  [[nodiscard]] const VectorMap& map() const { return story_.map(); }

 private:
  static constexpr MapHead kHead{0xBEEF'0000, 0};
  FrameLog log_{std::size_t{16} << 20};
  MapPublisher publisher_{log_, kHead};
  DriveJournal journal_;
  MapStory story_{2};
  MapStore store_;
  std::jthread thread_;
};

TEST_F(MapResumeTest, a_later_start_finds_what_the_map_was_made_from) {
  first_start();
  const auto found = earlier();
  ASSERT_TRUE(found);
  const Recollection& drive = found->drive;
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
  EXPECT_NEAR(earlier(kShort)->drive.guesses[0].T_map_odom.x_m, 48, 1e-6);
  EXPECT_FALSE(earlier(kLong, {49.01, 8.4, 112.0, 0.0})) << "a kilometre away";
  EXPECT_FALSE(*find_earlier_part(folder_ / "none.gpkg", kHere, kLong));
}

TEST_F(MapResumeTest, the_second_start_takes_the_lines_over_once_it_has_recalled_all) {
  first_start();
  const std::size_t first_line_count = story_.map().size();
  SecondStart second(directory_, earlier().value());
  second.step(news_of(20, 3));
  ASSERT_EQ(parts().size(), 2U);
  EXPECT_EQ(parts()[1].continues, 0);
  EXPECT_EQ(drive(parts()[1]).keyframes.size(), 3U);
  EXPECT_EQ(earlier()->part.number, parts()[0].number) << "the longer one";

  // It finds itself, and notes all of its keyframes again, where they are.
  JournalNews where = news_of(20, 4);
  for (JournalKeyframe& keyframe : where.keyframes) keyframe.T_map_vehicle.y_m = 7;
  where.found_itself = true;
  where.loops.push_back({4, 23, {0, 1, 0}, Eigen::Matrix3d::Identity()});
  second.step(std::move(where));
  EXPECT_EQ(parts()[1].continues, parts()[0].number);
  EXPECT_EQ(line_count(parts()[0]), first_line_count);
  const Recollection both = drive(parts()[1]);
  ASSERT_EQ(both.keyframes.size(), 24U);
  for (std::size_t k = 0; k < 24; ++k) EXPECT_EQ(both.graph.poses_map[k].y_m, k < 20 ? 0 : 7) << k;

  second.step({.keyframes = {}, .loops = {}, .found_itself = true, .recalled_all = true});
  second.step(news_of(24, 1));
  second.stop();
  EXPECT_EQ(line_count(parts()[0]), 0U);
  EXPECT_EQ(line_count(parts()[1]), second.map().size());
  const auto third = earlier();
  EXPECT_EQ(third->part.number, parts()[1].number);
  EXPECT_EQ(third->drive.keyframes.size(), 25U);
  EXPECT_EQ(third->drive.graph.loops.size(), 2U);
}

TEST_F(MapResumeTest, a_new_file_in_the_place_of_the_one_it_goes_on_with_gets_all_of_it) {
  first_start();
  const EarlierPart part = earlier().value();
  std::filesystem::remove(path_);
  SecondStart second(directory_, part);
  JournalNews news = news_of(20, 5);
  news.found_itself = news.recalled_all = true;
  second.step(std::move(news));
  second.stop();
  ASSERT_EQ(parts().size(), 1U);
  EXPECT_EQ(parts()[0].continues, 0);
  EXPECT_EQ(drive(parts()[0]).keyframes.size(), 25U);
  EXPECT_EQ(drive(parts()[0]).graph.loops.size(), 1U);
}

TEST_F(MapResumeTest, after_a_new_map_no_start_goes_on_with_those_before) {
  start();
  journal_.note(news_of(0, 20));
  publish(60);
  begin_anew();
  stop();
  EXPECT_FALSE(earlier());
}

TEST_F(MapResumeTest, a_keyframe_that_cannot_be_read_is_said_and_not_gone_on_with) {
  first_start();
  const auto sees = [&](const std::string& sql) {
    EXPECT_TRUE(Database::open(path_.string(), Database::Mode::make)->run(sql));
    return find_earlier_part(path_, kHere, kLong).error().text;
  };
  EXPECT_THAT(sees("UPDATE x_keyframes SET lvm = x'0102' WHERE keyframe = 7"), HasSubstr("keyframe 7"));
  EXPECT_THAT(sees("DELETE FROM x_keyframes WHERE keyframe = 5"), HasSubstr("keyframe 5"));
  EXPECT_THAT(sees("UPDATE x_keyframes SET step = zeroblob(95) WHERE keyframe = 3"), HasSubstr("keyframe 3"));
}

}  // namespace
}  // namespace roadvec
