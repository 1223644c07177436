// The real-time stages in threads of their own, as the daemon runs them, on packets, CAN frames and IMU bytes made
// here.

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstring>
#include <functional>
#include <thread>

#include "core/wire/codec.h"
#include "core/wire/map_replica.h"
#include "daemon/stages/lidar_stage.h"
#include "daemon/stages/mapping_stage.h"
#include "daemon/stages/optimiser_stage.h"
#include "daemon/stages/vehicle_stage.h"
#include "tests/support/allocation_count.h"

namespace roadvec {
namespace {

constexpr double kEye_m = 1.73, kHalfWidth_m = 4.0, kKerb_m = 0.14;

/// A VLP-16 in a straight street between kerbs, 0.14 m high, and walls 3 m behind them; the car drives at 5 m/s.
class StreetPackets final : public PacketSource {
 public:
  explicit StreetPackets(int packet_count) : left_(packet_count) {}
  ReadResult read(std::span<const RawPacket>& batch, std::chrono::milliseconds) noexcept override {
    if (left_ == 0) return ReadResult::end;
    --left_;
    fill();
    batch = {&packet_, 1};
    return ReadResult::packets;
  }
  [[nodiscard]] std::string_view error() const noexcept override { return {}; }

 private:
  void fill() noexcept {
    for (int block = 0; block < kBlocksPerPacket; ++block) {
      std::uint8_t* at = packet_.bytes.data() + static_cast<std::size_t>(block) * kBlockBytes;
      const int azimuth_cdeg = static_cast<int>((number_ * kBlocksPerPacket + block) * 40 % 36000);
      at[0] = 0xFF, at[1] = 0xEE;
      at[2] = static_cast<std::uint8_t>(azimuth_cdeg), at[3] = static_cast<std::uint8_t>(azimuth_cdeg >> 8);
      for (int lane = 0; lane < kLanesPerBlock; ++lane) {
        const auto raw = static_cast<std::uint16_t>(range_m(azimuth_cdeg / 100.0, lane % 16) / 0.002);
        at[4 + 3 * lane] = static_cast<std::uint8_t>(raw), at[5 + 3 * lane] = static_cast<std::uint8_t>(raw >> 8);
        at[6 + 3 * lane] = 60;
      }
    }
    const auto device_us = static_cast<std::uint32_t>(number_ * 1327);
    std::memcpy(packet_.bytes.data() + kDeviceTimeOffset, &device_us, 4);
    packet_.bytes[kReturnModeOffset] = kStrongestReturnMode;
    packet_.bytes[kProductIdOffset] = 0x22;
    packet_.arrived = {1'000'000'000 + number_ * 1'327'104};
    ++number_;
  }
  /// VLP-16 elevations alternate -15, 1, -13, 3, ...
  static double range_m(double azimuth_deg, int laser) noexcept {
    const double elevation = rad_from_deg(laser % 2 == 0 ? -15.0 + laser : laser);
    const double across = std::abs(std::sin(rad_from_deg(azimuth_deg))) * std::cos(elevation), up = std::sin(elevation);
    double range = up < 0 ? -kEye_m / up : 200.0;
    if (across > 1e-6) {
      const double at_kerb = kHalfWidth_m / across, at_wall = (kHalfWidth_m + 3) / across;
      if (range > at_kerb) {
        range = kEye_m + at_kerb * up < kKerb_m ? at_kerb : up < 0 ? (kKerb_m - kEye_m) / up : 200.0;
        if (range > at_wall && kEye_m + at_wall * up < 4.0) range = at_wall;
      }
    }
    return range > 90 ? 0 : range;
  }
  int left_;
  std::int64_t number_ = 0;
  RawPacket packet_;
};

/// Wheels and gyro at 100 Hz.
class SteadyMotion final : public MotionInput {
 public:
  explicit SteadyMotion(int sample_count) : left_(sample_count) { prepare(); }
  const MotionSample* front(std::chrono::milliseconds) noexcept override { return left_ > 0 ? &sample_ : nullptr; }
  void take() noexcept override {
    --left_;
    ++number_;
    prepare();
  }
  [[nodiscard]] bool over() const noexcept override { return left_ == 0; }
  void count(VehicleCounts& counts) const noexcept override {
    counts.can.frame_count = static_cast<std::uint64_t>(number_);
  }

 private:
  void prepare() noexcept {
    sample_.time = {1'000'000'000 + number_ * 5'000'000};
    if (number_ % 2 == 0) {
      sample_.value = WheelSpeed{5, 5, 5, 5};
    } else {
      sample_.value = ImuSample{.has_rate = true};
    }
  }
  int left_;
  std::int64_t number_ = 0;
  MotionSample sample_;
};

constexpr int kPackets = 75 * 40, kSamples = 200 * 4 + 20;  // 40 revolutions at 10 Hz, 4 s and a little more

std::vector<std::unique_ptr<MotionInput>> steady_motion() {
  std::vector<std::unique_ptr<MotionInput>> inputs;
  inputs.push_back(std::make_unique<SteadyMotion>(kSamples));
  return inputs;
}

FrontEndSetup front_end_setup() {
  return {.vehicle = {.wheelbase_m = 2.7, .track_m = 1.5, .steering_ratio = 15},
          .lidar = mounting_from({0, 0, kEye_m}, 0, 0, 0),
          .max_returns_per_sweep = max_returns_per_sweep(LidarModel::vlp16)};
}

struct Stages {
  Doorbell mapping_bell, optimiser_bell;
  SweepChannel sweeps{WhenFull::wait, mapping_bell};
  MotionChannel motion{WhenFull::wait, mapping_bell};
  KeyframeChannel keyframes{WhenFull::wait, optimiser_bell};
  Latest<PoseReport> poses;
  FrameLog frames{1 << 20};
  LidarCounters counters;
  Latencies latencies;
  ChangeStamps stamps;
  LidarStage lidar{std::make_unique<StreetPackets>(kPackets),
                   LidarModel::vlp16,
                   *built_in_calibration(LidarModel::vlp16),
                   {},
                   counters,
                   sweeps,
                   latencies};
  VehicleStage vehicle{steady_motion(), motion, false};
  MappingStage mapping{PipelineConfig{}, front_end_setup(), sweeps, motion, mapping_bell, keyframes, poses, latencies};
  OptimiserStage optimiser{PipelineConfig{}, keyframes, optimiser_bell, frames, {1, 0}, latencies, stamps};
  std::stop_source stop;
};

TEST(Stages, turn_packets_and_motion_into_a_map_with_nothing_lost) {
  Stages stages;
  {
    const std::jthread lidar([&] { stages.lidar.run(stages.stop.get_token()); });
    const std::jthread vehicle([&] { stages.vehicle.run(stages.stop.get_token()); });
    const std::jthread mapping([&] { stages.mapping.run(stages.stop.get_token()); });
    const std::jthread optimiser([&] { stages.optimiser.run(stages.stop.get_token()); });
  }
  EXPECT_EQ(stages.counters.received.value(), 0U) << "counted by the receiver, not the stage";
  EXPECT_EQ(stages.counters.ring_full.value(), 0U);
  EXPECT_EQ(stages.counters.device_time_gaps.value(), 0U);
  EXPECT_EQ(stages.vehicle.sample_count().value(), static_cast<std::uint64_t>(kSamples));
  EXPECT_EQ(stages.vehicle.counts().load().can.frame_count, static_cast<std::uint64_t>(kSamples));
  EXPECT_EQ(stages.mapping.sweep_count().value(), stages.lidar.sweeps_published().value());
  EXPECT_GE(stages.mapping.sweep_count().value(), 39U);
  EXPECT_GE(stages.optimiser.keyframe_count().value(), 8U);
  EXPECT_GT(stages.optimiser.back_end().report().map_length_m, 20.0);
}

TEST(Stages, the_order_in_which_threads_run_does_not_change_the_map) {
  VectorMap maps[2];
  for (int run = 0; run < 2; ++run) {
    Stages stages;
    {
      const std::jthread optimiser([&] { stages.optimiser.run(stages.stop.get_token()); });
      const std::jthread mapping([&] { stages.mapping.run(stages.stop.get_token()); });
      if (run == 1) std::this_thread::sleep_for(std::chrono::milliseconds(200));
      const std::jthread vehicle([&] { stages.vehicle.run(stages.stop.get_token()); });
      if (run == 1) std::this_thread::sleep_for(std::chrono::milliseconds(200));
      const std::jthread lidar([&] { stages.lidar.run(stages.stop.get_token()); });
    }
    maps[run] = stages.optimiser.back_end().map();
  }
  ASSERT_FALSE(maps[0].empty());
  ASSERT_EQ(maps[0].size(), maps[1].size());
  for (const auto& [id, line] : maps[0]) {
    ASSERT_TRUE(maps[1].contains(id));
    EXPECT_EQ(line.vertices, maps[1].at(id).vertices);
    EXPECT_EQ(line.attributes, maps[1].at(id).attributes);
  }
}

/// Gives half the packets, waits until they are mapped, and notes how often each thread has allocated until then.
class PausedPackets final : public PacketSource {
 public:
  explicit PausedPackets(std::function<void()> at_half) : at_half_(std::move(at_half)) {}
  ReadResult read(std::span<const RawPacket>& batch, std::chrono::milliseconds timeout) noexcept override {
    if (++reads_ == kPackets / 2) at_half_();
    return inner_.read(batch, timeout);
  }
  [[nodiscard]] std::string_view error() const noexcept override { return {}; }

 private:
  StreetPackets inner_{kPackets};
  std::function<void()> at_half_;
  int reads_ = 0;
};

TEST(Stages, real_time_threads_do_not_allocate_once_warm) {
  Stages stages;
  enum : std::size_t { kLidar, kVehicle, kMapping, kThreads };
  std::array<std::atomic<const std::atomic<std::size_t>*>, kThreads> counts{};
  std::array<std::size_t, kThreads> warm{}, end{};
  const auto at_half = [&] {
    while (stages.mapping.sweep_count().value() < 18) std::this_thread::yield();
    for (std::size_t i = 0; i < kThreads; ++i) warm[i] = counts[i].load()->load();
  };
  LidarStage lidar_stage{std::make_unique<PausedPackets>(at_half),
                         LidarModel::vlp16,
                         *built_in_calibration(LidarModel::vlp16),
                         {},
                         stages.counters,
                         stages.sweeps,
                         stages.latencies};
  const auto counted = [&](std::size_t thread, auto&& run) {
    counts[thread] = &test::allocation_count();
    run();
    end[thread] = test::allocation_count();
  };
  {
    const std::jthread mapping([&] { counted(kMapping, [&] { stages.mapping.run(stages.stop.get_token()); }); });
    const std::jthread vehicle([&] { counted(kVehicle, [&] { stages.vehicle.run(stages.stop.get_token()); }); });
    while (counts[kMapping] == nullptr || counts[kVehicle] == nullptr) std::this_thread::yield();
    const std::jthread lidar([&] { counted(kLidar, [&] { lidar_stage.run(stages.stop.get_token()); }); });
    const std::jthread optimiser([&] { stages.optimiser.run(stages.stop.get_token()); });
  }
  EXPECT_GT(stages.mapping.sweep_count().value(), 30U);
  EXPECT_EQ(end[kLidar], warm[kLidar]);
  EXPECT_EQ(end[kVehicle], warm[kVehicle]);
  EXPECT_EQ(end[kMapping], warm[kMapping]);
}

TEST(Stages, a_new_map_is_begun_in_the_middle_of_a_drive) {
  Stages stages;
  const auto at_half = [&] {
    while (stages.optimiser.keyframe_count().value() < 3) std::this_thread::yield();
    stages.optimiser.begin_new_map();
    while (stages.optimiser.reports().load().head.epoch == 1) std::this_thread::yield();
  };
  LidarStage lidar_stage{std::make_unique<PausedPackets>(at_half),
                         LidarModel::vlp16,
                         *built_in_calibration(LidarModel::vlp16),
                         {},
                         stages.counters,
                         stages.sweeps,
                         stages.latencies};
  {
    const std::jthread optimiser([&] { stages.optimiser.run(stages.stop.get_token()); });
    const std::jthread mapping([&] { stages.mapping.run(stages.stop.get_token()); });
    const std::jthread vehicle([&] { stages.vehicle.run(stages.stop.get_token()); });
    const std::jthread lidar([&] { lidar_stage.run(stages.stop.get_token()); });
  }
  wire::MapReplica followed = wire::MapReplica::empty_at(1, 0);
  FrameLog::Position position = 0;
  int replaced_count = 0;
  for (std::string frame; stages.frames.read(position, frame) == FrameLog::Outcome::frame;) {
    const auto message =
        wire::decode_envelope(std::string_view(frame).substr(wire::kFrameHeaderBytes), wire::Sender::server);
    ASSERT_TRUE(message);
    ASSERT_EQ(followed.apply(*message), wire::MapReplica::Outcome::applied);
    const auto* change = std::get_if<wire::EpochChange>(&*message);
    replaced_count += change != nullptr && change->reason == wire::EpochChange::Reason::map_replaced ? 1 : 0;
  }
  const BackEnd& back_end = stages.optimiser.back_end();
  EXPECT_EQ(replaced_count, 1);
  EXPECT_LT(back_end.report().keyframe_count, stages.optimiser.keyframe_count().value());
  EXPECT_GT(back_end.report().map_length_m, 5.0);
  EXPECT_EQ(followed.lines().size(), back_end.map().size());
  EXPECT_GE(back_end.trajectory().front().T_map_vehicle.x_m, 4.0) << "where the vehicle was, not at the origin";
}

TEST(Stages, motion_is_followed_for_as_long_as_the_lidar_is_silent) {
  Doorbell mapping_bell, optimiser_bell;
  SweepChannel sweeps{WhenFull::refuse, mapping_bell};
  MotionChannel motion{WhenFull::refuse, mapping_bell};
  KeyframeChannel keyframes{WhenFull::refuse, optimiser_bell};
  Latest<PoseReport> poses;
  Latencies latencies;
  MappingStage mapping{PipelineConfig{}, front_end_setup(), sweeps, motion, mapping_bell, keyframes, poses, latencies};
  std::stop_source stop;
  const std::jthread thread([&] { mapping.run(stop.get_token()); });
  Sweep& sweep = *sweeps.claim({});
  sweep.start = {1'000'000'000};
  sweep.end = {1'100'000'000};
  sweeps.publish();
  while (mapping.sweep_count().value() == 0) std::this_thread::yield();
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  std::int64_t count = 0;
  for (; count < 30'000 && std::chrono::steady_clock::now() < give_up; ++count) {  // 300 s at 100 Hz
    MotionSample* slot = nullptr;
    while ((slot = motion.claim({})) == nullptr && std::chrono::steady_clock::now() < give_up)
      std::this_thread::yield();
    if (slot == nullptr) break;
    *slot = {{1'100'000'000 + count * 10'000'000}, WheelSpeed{5, 5, 5, 5}};
    motion.publish();
  }
  stop.request_stop();
  EXPECT_EQ(count, 30'000);
}

TEST(AllocationCount, counts) {
  const std::size_t before = test::allocation_count();
  const auto memory = std::make_unique<int>(1);
  EXPECT_EQ(*memory, 1);
  EXPECT_EQ(test::allocation_count(), before + 1);
}

TEST(Doorbell, wakes_the_waiting_thread_and_keeps_a_ring_for_later) {
  Doorbell bell;
  bell.ring();
  const auto begin = std::chrono::steady_clock::now();
  bell.wait(std::chrono::seconds(10));
  std::jthread other([&] { bell.ring(); });
  bell.wait(std::chrono::seconds(10));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(9));
}

TEST(DurationHistogram, gives_percentiles_within_its_step) {
  DurationHistogram histogram;
  for (int i = 1; i <= 1000; ++i) histogram.add(std::chrono::microseconds(i));
  const DurationHistogram::Summary summary = histogram.summary();
  EXPECT_EQ(summary.count, 1000U);
  EXPECT_NEAR(summary.p50_us, 500, 25);
  EXPECT_NEAR(summary.p99_us, 990, 45);
  EXPECT_EQ(summary.max_us, 1000);
  EXPECT_EQ(summary.sum_us, 500'500);
  EXPECT_EQ(DurationHistogram{}.summary().count, 0U);
}

TEST(DurationHistogram, counts_exactly_what_took_at_most_a_power_of_two) {
  DurationHistogram histogram;
  for (const int us : {1, 1024, 1025, 2048, 8'388'608, 8'388'609}) histogram.add(std::chrono::microseconds(us));
  const auto counts = histogram.at_most_counts();
  EXPECT_EQ(counts.front(), 2U);
  EXPECT_EQ(counts[1], 4U);
  EXPECT_EQ(counts[2], 4U);
  EXPECT_EQ(counts.back(), 5U);
}

}  // namespace
}  // namespace roadvec
