#include "daemon/server/map_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/map/tiles.h"
#include "core/wire/codec.h"
#include "daemon/server/text_writer.h"
#include "tests/support/map_story.h"

namespace roadvec {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

const Anchor kAnchor{49.0, 8.4, 112.0, -70.98};

MapLine kerb() {
  MapLine line;
  line.id = 42;
  line.revision = 7;
  line.attributes = {BoundaryKind::curb, EndKind::open, EndKind::occluded, 0.12F, 0.95F, 33};
  line.first_seen.ns = 1'300'000'000'000'000'001;
  line.last_seen.ns = 1'300'000'001'500'000'000;
  line.vertices = {{0, 0, 0, 0.12F, 0.03F, 0.4F}, {100, 0, 0, 0.12F, 0.04F, 0.4F}};
  return line;
}

TEST(GeoJson, places_the_anchor_at_the_origin_and_east_to_the_east) {
  const std::string text = geojson_of({{42, kerb()}}, kAnchor);
  EXPECT_THAT(text, HasSubstr("[8.400000000,49.000000000,112.0000]"));
  // 100 m east at 49 degrees north: 73.1 km per degree; the tangent plane is 0.8 mm above the ellipsoid there.
  EXPECT_THAT(text, HasSubstr(",[8.40136"));
  EXPECT_THAT(text, HasSubstr(",112.0008]"));
}

TEST(GeoJson, carries_every_attribute) {
  const std::string text = geojson_of({{42, kerb()}}, kAnchor);
  EXPECT_THAT(
      text,
      HasSubstr(R"("id":42,"revision":7,"kind":"curb","height_m":0.120,"existence":0.950,"observation_count":33)"));
  EXPECT_THAT(text, HasSubstr(R"("first_end":"open","last_end":"occluded")"));
  EXPECT_THAT(text, HasSubstr(R"("first_seen_s":1300000000.000000001,"last_seen_s":1300000001.500000000)"));
  EXPECT_THAT(text, HasSubstr(R"("sigma_across_m":0.035,"sigma_along_m":0.400)"));
}

TEST(GeoJson, a_line_of_one_vertex_is_no_line_string) {
  MapLine dot = kerb();
  dot.vertices.resize(1);
  EXPECT_THAT(geojson_of({{42, dot}}, kAnchor), Not(HasSubstr("LineString")));
  EXPECT_THAT(geojson_of({}, kAnchor), HasSubstr("\"features\":[\n]"));
}

/// The line as a way, without its end; empty: it was left out.
std::string way_of(const MapLine& line) {
  const std::string text = lanelet2_of({{line.id, line}}, kAnchor);
  const std::size_t begin = text.find("<way");
  return begin == std::string::npos ? "" : text.substr(begin, text.find("</way>") - begin);
}

TEST(Lanelet2, tells_kerbs_by_their_height_and_takes_a_barrier_for_the_end_of_the_road) {
  MapLine line = kerb();
  EXPECT_THAT(way_of(line),
              HasSubstr(R"(<tag k="type" v="curbstone"/><tag k="subtype" v="high"/><tag k="height" v="0.120"/>)"));
  line.attributes.height_m = 0.05F;
  EXPECT_THAT(way_of(line), HasSubstr(R"(<tag k="subtype" v="low"/>)"));
  line.attributes.kind = BoundaryKind::barrier;
  line.attributes.height_m = 1.2F;
  EXPECT_THAT(way_of(line), HasSubstr(R"(<tag k="type" v="road_border"/><tag k="height" v="1.200"/>)"));
  line.attributes.kind = BoundaryKind::vehicle_row;
  EXPECT_EQ(way_of(line), "");
}

TEST(Lanelet2, places_nodes_with_their_height_before_the_ways_that_use_them) {
  const std::string text = lanelet2_of({{42, kerb()}}, kAnchor);
  EXPECT_THAT(text, HasSubstr("<node id=\"1\" version=\"1\" visible=\"true\" lat=\"49.000000000\" lon=\"8.400000000\">"
                              "<tag k=\"ele\" v=\"112.0000\"/></node>"));
  EXPECT_THAT(text, HasSubstr("<nd ref=\"1\"/><nd ref=\"2\"/>"));
  EXPECT_LT(text.find("node id=\"2\""), text.find("<way"));
}

TEST(Lanelet2, keeps_nodes_five_centimetres_apart_and_both_ends) {
  MapLine line = kerb();
  line.vertices = {{0, 0}, {0.03, 0}, {1, 0}, {1.02, 0}, {1.96, 0}, {2, 0}};
  const std::string text = lanelet2_of({{42, line}}, kAnchor);
  EXPECT_THAT(way_of(line), HasSubstr("<nd ref=\"1\"/><nd ref=\"2\"/><nd ref=\"3\"/><tag"));
  line.vertices = {{0, 0}, {1, 0}, {2, 0}};
  EXPECT_EQ(lanelet2_of({{42, line}}, kAnchor), text);
}

TEST(Lanelet2, a_ring_stays_and_a_dot_goes) {
  MapLine line = kerb();
  line.vertices = {{0, 0}, {1, 0}, {1, 1}, {0, 0}};
  EXPECT_THAT(way_of(line), HasSubstr("<nd ref=\"4\"/><tag"));
  line.vertices = {{0, 0}, {0.02, 0}, {0.04, 0}};
  EXPECT_EQ(way_of(line), "");
  line.vertices.resize(1);
  EXPECT_EQ(way_of(line), "");
}

TEST(TileBytes, are_what_a_client_receives_of_every_tile) {
  EXPECT_EQ(tile_bytes({}), 0U);
  MapLine far = kerb();
  far.id = 43;
  for (Vertex& vertex : far.vertices) vertex.y_m += 1000;
  std::vector<char> buffer(1 << 20);
  std::size_t bytes = 0;
  for (const MapLine& line : {kerb(), far}) {
    for (const auto& [key, pieces] : pieces_of(line)) {
      bytes += wire::encode_frame(Tile{key, 1, pieces}, buffer).size();
    }
  }
  EXPECT_EQ(tile_bytes({{42, kerb()}, {43, far}}), bytes);
  EXPECT_GT(bytes, 4 * 30U) << "each line lies in two tiles";
}

TEST(Svg, shows_every_line_in_the_colour_of_its_kind_within_the_picture) {
  const std::string text = svg_of({{42, kerb()}}, {}, "A <map> & more");
  EXPECT_THAT(text, HasSubstr("A &lt;map&gt; &amp; more"));
  EXPECT_THAT(text, HasSubstr("1 lines, 100.0 m, area 100"));
  EXPECT_THAT(text, HasSubstr("<polyline points=\"28.0,"));
  EXPECT_THAT(text, HasSubstr("1372.0,"));
}

TEST(Svg, of_nothing_and_of_kilometres_has_a_scale) {
  EXPECT_THAT(svg_of({}, {}, "empty"), HasSubstr(">2 m<"));
  MapLine road = kerb();
  road.vertices.back().x_m = 2000;
  road.vertices.back().y_m = 1500;
  const Eigen::Vector2d path[] = {{0, 5}, {2000, 1505}};
  const std::string text = svg_of({{42, road}}, path, "long");
  EXPECT_THAT(text, HasSubstr(">200 m<"));
  EXPECT_THAT(text, HasSubstr("trajectory"));
}

TEST(MapFiles, are_the_same_bytes_for_the_same_map) {
  MapStory one(4), other(4);
  for (int i = 0; i < 80; ++i) (void)one.step(), (void)other.step();
  EXPECT_EQ(geojson_of(one.map(), kAnchor), geojson_of(other.map(), kAnchor));
  EXPECT_EQ(svg_of(one.map(), {}, "t"), svg_of(other.map(), {}, "t"));
}

TEST(TextWriter, writes_numbers_and_strings_that_json_takes) {
  EXPECT_EQ(decimal(-0.0001, 3), "0.000");
  EXPECT_EQ(decimal(-1.0005, 3).substr(0, 4), "-1.0");
  EXPECT_EQ(seconds_text(-1), "-0.000000001");
  EXPECT_EQ(seconds_text(1'000'000'000), "1.000000000");
  EXPECT_EQ(json_text("a\"b\\c\n"), R"("a\"b\\c\u000a")");
}

}  // namespace
}  // namespace roadvec
