#pragma once

#include <gmock/gmock.h>

#include <thread>

#include "daemon/store/map_store.h"
#include "tests/support/map_story.h"
#include "tests/support/temporary_folder.h"

namespace roadvec {

inline constexpr MapHead kFirst{0xFEED'0000, 0};
inline constexpr std::chrono::seconds kLongest{20};

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
                                                       .earlier = std::nullopt},
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

  /// The story's map is forgotten, at its owner's wish.
  void begin_anew() {
    MapChange anew;
    anew.begins_anew = true;
    for (const auto& [id, line] : story_.map()) anew.removed.push_back(id);
    journal_.begin_new_map();
    publisher_.publish(anew, {}, [](std::size_t) {});
    story_ = MapStory{2};
  }

  TemporaryFolder folder_;
  const std::filesystem::path directory_ = folder_ / "state", path_ = directory_ / "map.gpkg";
  std::chrono::milliseconds last_tries_{5000};
  FrameLog log_{std::size_t{16} << 20};
  DriveJournal journal_;
  MapPublisher publisher_{log_, kFirst};
  MapStory story_{1};
  std::unique_ptr<MapStore> store_;
  bool followed_to_the_end_ = false;
  std::jthread thread_;
};

}  // namespace roadvec
