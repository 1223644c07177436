#include "daemon/store/map_copy.h"

#include <gtest/gtest.h>

#include "tests/support/map_story.h"

namespace roadvec {
namespace {

constexpr MapHead kBegin{77, 5};

/// A story told into a log, and the copy that follows it.
class MapCopyTest : public ::testing::Test {
 protected:
  bool follow() {
    std::string frame;
    while (reader_.next(frame) == FrameLog::Outcome::frame) {
      if (!copy_.take(frame)) return false;
    }
    return true;
  }
  void publish(const MapChange& change, const VectorMap& map) {
    publisher_.publish(change, map, [](std::size_t) {});
  }

  FrameLog log_{std::size_t{8} << 20};
  FrameLog::Reader reader_{log_};
  MapPublisher publisher_{log_, kBegin};
  MapCopy copy_{kBegin};
};

TEST_F(MapCopyTest, is_the_map_after_every_change) {
  MapStory story(3);
  for (int step = 0; step < 200; ++step) {
    publish(story.step(), story.map());
    ASSERT_TRUE(follow());
    ASSERT_EQ(difference_between(copy_.map(), story.map()), std::nullopt) << "step " << step;
    ASSERT_EQ(copy_.head().seq, publisher_.head().seq);
    ASSERT_EQ(copy_.head().epoch, publisher_.head().epoch);
  }
}

TEST_F(MapCopyTest, names_what_changed_since_it_was_written) {
  MapStory story(3);
  for (int step = 0; step < 30; ++step) publish(story.step(), story.map());
  ASSERT_TRUE(follow());
  copy_.written();
  const MapChange change = story.step();
  publish(change, story.map());
  ASSERT_TRUE(follow());
  EXPECT_EQ(copy_.changed(), std::set<LineId>(change.upserted.begin(), change.upserted.end()));
  copy_.all_changed();
  EXPECT_EQ(copy_.changed().size(), story.map().size());
}

/// A kilometre of line, dense enough for several frames.
MapLine long_line(LineId id) {
  MapLine line;
  line.id = id;
  line.revision = 1;
  for (int i = 0; i < 40'000; ++i) line.vertices.push_back({0.025 * i, 0.5 * static_cast<double>(id)});
  return line;
}

TEST_F(MapCopyTest, a_change_in_several_frames_counts_when_its_last_has_come) {
  VectorMap map{{1, long_line(1)}};
  MapChange change;
  change.upserted = {1};
  publish(change, map);
  std::string frame;
  ASSERT_EQ(reader_.next(frame), FrameLog::Outcome::frame);
  ASSERT_TRUE(copy_.take(frame));
  EXPECT_EQ(copy_.head().seq, kBegin.seq);
  EXPECT_TRUE(copy_.map().empty());
  ASSERT_TRUE(follow());
  EXPECT_EQ(copy_.head().seq, publisher_.head().seq);
  EXPECT_GT(publisher_.head().seq, kBegin.seq + 1);
  EXPECT_EQ(copy_.map().at(1).vertices.size(), 40'000U);
}

TEST_F(MapCopyTest, a_gap_is_noticed) {
  MapStory story(1);
  for (int step = 0; step < 3; ++step) publish(story.step(), story.map());
  std::string frame;
  ASSERT_EQ(reader_.next(frame), FrameLog::Outcome::frame);
  ASSERT_EQ(reader_.next(frame), FrameLog::Outcome::frame);
  EXPECT_FALSE(copy_.take(frame));
}

}  // namespace
}  // namespace roadvec
