#include "daemon/store/geometry.h"

#include <gtest/gtest.h>

namespace roadvec {
namespace {

const std::vector<GeoPosition> kLine{{8.4, 49.0, 112.0}, {8.5, 48.9, 113.5}, {8.45, 49.1, -2.0}};

GeoEnvelope envelope_of(const std::vector<GeoPosition>& line) {
  GeoEnvelope envelope;
  for (const GeoPosition& p : line) envelope.add(p);
  return envelope;
}

TEST(GeometryBlob, reads_back_what_it_wrote) {
  const GeoEnvelope envelope = envelope_of(kLine);
  EXPECT_EQ(envelope.min_longitude_deg, 8.4);
  EXPECT_EQ(envelope.max_latitude_deg, 49.1);
  const std::vector<std::uint8_t> blob = geometry_blob(kLine, envelope);
  EXPECT_EQ(blob.size(), 8U + 32 + 9 + 3 * 24);
  EXPECT_EQ(positions_in(blob), kLine);
}

TEST(GeometryBlob, of_every_length_but_the_right_one_is_refused) {
  std::vector<std::uint8_t> blob = geometry_blob(kLine, envelope_of(kLine));
  for (std::size_t size = 0; size < blob.size(); ++size) {
    EXPECT_FALSE(positions_in(std::span(blob).first(size))) << size;
  }
  blob.push_back(0);
  EXPECT_FALSE(positions_in(blob));
}

TEST(GeometryBlob, with_another_magic_type_byte_order_or_place_off_the_earth_is_refused) {
  const std::vector<std::uint8_t> good = geometry_blob(kLine, envelope_of(kLine));
  for (const std::size_t at : {std::size_t{0}, std::size_t{1}, std::size_t{40}, std::size_t{41}, std::size_t{45}}) {
    std::vector<std::uint8_t> bad = good;
    bad[at] ^= 0x21;
    EXPECT_FALSE(positions_in(bad)) << at;
  }
  std::vector<std::uint8_t> far = good;
  far[8 + 32 + 9 + 7] = 0x7F;  // exponent of the first longitude
  EXPECT_FALSE(positions_in(far));
  std::vector<std::uint8_t> unknown_envelope = good;
  unknown_envelope[3] = 1 | 7 << 1;
  EXPECT_FALSE(positions_in(unknown_envelope));
}

}  // namespace
}  // namespace roadvec
