#include "core/map/tiles.h"

#include <gtest/gtest.h>

#include <limits>

#include "core/geometry/segment.h"
#include "tests/support/map_story.h"

namespace roadvec {
namespace {

MapLine line_of(LineId id, std::vector<Eigen::Vector2d> points) {
  MapLine line;
  line.id = id;
  line.revision = 1;
  for (const Eigen::Vector2d& p : points) line.vertices.push_back({p.x(), p.y()});
  return line;
}

std::vector<std::uint32_t> firsts(const std::vector<TilePiece>& pieces) {
  std::vector<std::uint32_t> result;
  for (const TilePiece& piece : pieces) result.push_back(piece.first_vertex);
  return result;
}

TEST(Tiles, the_tile_of_a_point_is_its_floor_on_both_sides_of_zero) {
  EXPECT_EQ(tile_of(0, 0), (TileKey{0, 0}));
  EXPECT_EQ(tile_of(63'999, 64'000), (TileKey{0, 1}));
  EXPECT_EQ(tile_of(-1, -64'000), (TileKey{-1, -1}));
  EXPECT_EQ(tile_of(-64'001, kFarthest_mm), (TileKey{-2, 15'625}));
}

TEST(Tiles, millimetres_of_what_is_not_a_number_stay_publishable) {
  EXPECT_EQ(mm_from_m(1.2345), 1235);
  EXPECT_EQ(mm_from_m(-0.0004), 0);
  EXPECT_EQ(mm_from_m(std::numeric_limits<double>::quiet_NaN()), kFarthest_mm);
  EXPECT_EQ(mm_from_m(-std::numeric_limits<double>::infinity()), -kFarthest_mm);
}

TEST(Tiles, a_segment_that_crosses_a_tile_without_a_vertex_in_it_is_in_it) {
  const auto tiles = pieces_of(line_of(1, {{10, 10}, {150, 10}}));
  ASSERT_EQ(tiles.size(), 3U);
  for (const auto& [key, pieces] : tiles) {
    ASSERT_EQ(pieces.size(), 1U);
    EXPECT_EQ(pieces[0].vertices.size(), 2U);
    EXPECT_EQ(pieces[0].line_vertex_count, 2U);
  }
}

TEST(Tiles, a_diagonal_does_not_enter_the_tiles_that_only_its_box_reaches) {
  const auto tiles = pieces_of(line_of(1, {{10, 20}, {100, 110}}));
  EXPECT_TRUE(tiles.contains({0, 0}));
  EXPECT_TRUE(tiles.contains({0, 1}));
  EXPECT_TRUE(tiles.contains({1, 1}));
  EXPECT_FALSE(tiles.contains({1, 0}));
}

TEST(Tiles, a_line_that_leaves_a_tile_and_returns_has_two_pieces_there) {
  const auto tiles = pieces_of(line_of(1, {{50, 10}, {80, 10}, {100, 20}, {100, 30}, {80, 40}, {50, 40}, {40, 41}}));
  EXPECT_EQ(firsts(tiles.at({0, 0})), (std::vector<std::uint32_t>{0, 4}));
  EXPECT_EQ(tiles.at({0, 0})[0].vertices.size(), 2U);
  EXPECT_EQ(tiles.at({0, 0})[1].vertices.size(), 3U);
  EXPECT_EQ(firsts(tiles.at({1, 0})), (std::vector<std::uint32_t>{0}));
}

TEST(Tiles, pieces_give_the_line_back_and_say_when_one_is_missing) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> step_m(-70, 90);
    std::vector<Eigen::Vector2d> points{{0, 0}};
    for (int i = 0; i < 30; ++i) {
      const Eigen::Vector2d next = points.back() + Eigen::Vector2d(step_m(random), step_m(random));
      points.push_back({std::round(next.x() * 1000) / 1000.0, std::round(next.y() * 1000) / 1000.0});
    }
    const MapLine line = line_of(7, points);
    std::vector<const TilePiece*> pieces;
    const auto tiles = pieces_of(line);
    for (const auto& [key, in_tile] : tiles) {
      for (const TilePiece& piece : in_tile) pieces.push_back(&piece);
    }
    MapLine again;
    ASSERT_TRUE(stitch(pieces, again)) << "seed " << seed;
    EXPECT_EQ(again.vertices, line.vertices) << "seed " << seed;
    std::erase_if(pieces, [](const TilePiece* piece) { return piece->first_vertex == 0; });
    EXPECT_FALSE(stitch(pieces, again)) << "seed " << seed;
  }
}

TEST(Tiles, every_point_of_a_line_lies_in_a_tile_that_has_its_segment) {
  MapStory story(3);
  for (int i = 0; i < 100; ++i) (void)story.step();
  for (const auto& [id, line] : story.map()) {
    const auto tiles = pieces_of(line);
    for (std::size_t i = 0; i + 1 < line.vertices.size(); ++i) {
      const Segment segment{line.vertices[i].position(), line.vertices[i + 1].position()};
      for (double t = 0; t <= 1; t += 0.05) {
        const Eigen::Vector2d p = segment.a + t * segment.direction();
        const auto tile = tiles.find(tile_of(mm_from_m(p.x()), mm_from_m(p.y())));
        ASSERT_NE(tile, tiles.end());
        EXPECT_TRUE(std::ranges::any_of(tile->second, [&](const TilePiece& piece) {
          return piece.first_vertex <= i && i + 1 < piece.first_vertex + piece.vertices.size();
        }));
      }
    }
  }
}

TEST(TileTable, a_line_that_moves_out_of_a_tile_is_removed_there) {
  TileTable table;
  VectorMap map{{1, line_of(1, {{10, 10}, {20, 10}})}};
  MapChange change;
  change.upserted = {1};
  std::vector<TileDelta> deltas = table.apply(change, map);
  ASSERT_EQ(deltas.size(), 1U);
  EXPECT_EQ(deltas[0].revision, 1U);

  map.at(1) = line_of(1, {{70, 10}, {80, 10}});
  deltas = table.apply(change, map);
  ASSERT_EQ(deltas.size(), 2U);
  EXPECT_EQ(deltas[0].key, (TileKey{0, 0}));
  EXPECT_EQ(deltas[0].removed, (std::vector<LineId>{1}));
  EXPECT_TRUE(deltas[0].upserted.empty());
  EXPECT_EQ(deltas[0].revision, 2U);
  EXPECT_EQ(deltas[1].key, (TileKey{1, 0}));
  EXPECT_EQ(deltas[1].upserted.size(), 1U);

  map.clear();
  deltas = table.apply({.upserted = {}, .removed = {1, 99}, .lineage = {}, .T_map_odom = {}, .time = {}}, map);
  ASSERT_EQ(deltas.size(), 1U);
  EXPECT_EQ(deltas[0].key, (TileKey{1, 0}));
  EXPECT_EQ(deltas[0].removed, (std::vector<LineId>{1}));
}

TEST(TileTable, the_same_changes_give_the_same_deltas) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    MapStory one(seed), other(seed);
    TileTable table, again;
    for (int i = 0; i < 150; ++i) {
      const MapChange change = one.step(), same = other.step();
      EXPECT_EQ(table.apply(change, one.map()), again.apply(same, other.map())) << "seed " << seed;
    }
  }
}

}  // namespace
}  // namespace roadvec
