#include "drivers/velodyne/beams.h"

#include <gmock/gmock.h>

#include <cstring>
#include <memory>
#include <random>

#include "core/base/angle.h"
#include "drivers/velodyne/packet.h"
#include "tests/drivers/velodyne/packets.h"
#include "tests/support/allocation_count.h"

namespace roadvec {
namespace {

BeamTable random_table(std::mt19937& random, Correction correction) {
  std::uniform_real_distribution<double> within(-1, 1);
  BeamTable table;
  for (int lane = 0; lane < kLanesPerBlock; ++lane) {
    table.set(lane,
              {.enabled = within(random) > -0.9,
               .rotation_rad = 0.2 * within(random),
               .elevation_rad = 0.5 * within(random),
               .distance_m = 1.3 + 0.1 * within(random),
               .distance_x_m = 1.3 + 0.1 * within(random),
               .distance_y_m = 1.3 + 0.1 * within(random),
               .vertical_offset_m = 0.2 * within(random),
               .horizontal_offset_m = 0.03 * within(random),
               .focal_distance_m = 12 + 10 * within(random),
               .focal_slope = 1 + within(random),
               .min_intensity = 20 + 20 * within(random),
               .max_intensity = 200 + 50 * within(random)},
              within(random), correction);
  }
  table.turn_by(static_cast<float>(0.02 * within(random)));
  return table;
}

TEST(Beams, come_out_the_same_to_the_last_bit_however_many_are_worked_out_at_once) {
  if (!lanes_available(BeamLanes::eight)) {
    std::printf("this machine works out four lanes at once and no more\n");
    return;
  }
  const auto by_four = std::make_unique<BeamPoints>(), by_eight = std::make_unique<BeamPoints>();
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937 random(seed);
    const Correction correction = seed % 2 == 0 ? Correction::manual : Correction::ros;
    const BeamTable table = random_table(random, correction);
    PacketBytes bytes;
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
    BeamOptions options{.distance_lsb_m = 0.002F, .correction = correction, .corrects_intensity = seed % 3 == 0};
    for (std::size_t block = 0; block < kBlocksPerPacket; ++block) {
      const Heading heading = heading_at(static_cast<std::uint16_t>(random() % kFullCircle_cdeg));
      const std::uint8_t* const echoes = bytes.data() + block * kBlockBytes + kBlockEchoesOffset;
      options.lanes = BeamLanes::four;
      place_echoes(echoes, table, heading, options, *by_four, block % 8 * kLanesPerBlock);
      options.lanes = BeamLanes::eight;
      place_echoes(echoes, table, heading, options, *by_eight, block % 8 * kLanesPerBlock);
    }
    ASSERT_EQ(std::memcmp(by_four.get(), by_eight.get(), sizeof(BeamPoints)), 0) << "seed " << seed;
  }
}

TEST(SweepDecoder, does_not_allocate_per_packet) {
  for (const LidarModel model : kAllModels) {
    Bench bench(model);
    FakeHead head(model);
    bench.driver.add(head.next());
    const std::size_t before = test::allocation_count();
    for (int i = 0; i < 50; ++i) bench.driver.add(head.next());
    EXPECT_EQ(test::allocation_count(), before) << name_of(model);
  }
}

}  // namespace
}  // namespace roadvec
