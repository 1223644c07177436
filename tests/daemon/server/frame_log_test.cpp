#include "daemon/server/frame_log.h"

#include <gtest/gtest.h>

#include <thread>

namespace roadvec {
namespace {

using Outcome = FrameLog::Outcome;

/// A frame whose length and content follow from its number, so that a torn copy shows.
std::string numbered(std::uint32_t number) {
  return std::string(4 + number % 97, static_cast<char>('a' + number % 26)) + std::to_string(number);
}

TEST(FrameLog, gives_frames_back_in_order_and_says_when_there_is_none) {
  FrameLog log(1024);
  FrameLog::Reader reader(log);
  std::string frame;
  EXPECT_EQ(reader.next(frame), Outcome::nothing_new);
  for (std::uint32_t i = 0; i < 500; ++i) {
    log.append(numbered(i));
    ASSERT_EQ(reader.next(frame), Outcome::frame);
    EXPECT_EQ(frame, numbered(i));
    EXPECT_EQ(reader.next(frame), Outcome::nothing_new);
  }
}

TEST(FrameLog, tells_a_slow_reader_and_goes_on_at_the_oldest_frame) {
  FrameLog log(1024);
  FrameLog::Reader reader(log);
  for (std::uint32_t i = 0; i < 100; ++i) log.append(numbered(i));
  std::string frame;
  EXPECT_EQ(reader.next(frame), Outcome::overrun);
  std::uint32_t count = 0;
  while (reader.next(frame) == Outcome::frame) ++count;
  EXPECT_GT(count, 5U);
  EXPECT_EQ(frame, numbered(99));
}

TEST(FrameLog, has_room_until_a_registered_reader_would_lose_a_frame) {
  FrameLog log(1024);
  FrameLog::Reader reader(log);
  std::uint32_t written = 0;
  while (log.has_room(numbered(written).size())) log.append(numbered(written++));
  EXPECT_GT(written, 5U);
  std::string frame;
  for (std::uint32_t i = 0; i < written; ++i) {
    ASSERT_EQ(reader.next(frame), Outcome::frame);
    EXPECT_EQ(frame, numbered(i));
  }
  EXPECT_TRUE(log.has_room(numbered(written).size()));
}

TEST(FrameLog, rings_the_doorbell_of_every_reader) {
  FrameLog log(1024);
  FrameLog::Reader one(log), other(log);
  log.append("x");
  for (FrameLog::Reader* reader : {&one, &other}) {
    std::uint64_t rings = 0;
    EXPECT_EQ(::read(reader->doorbell(), &rings, sizeof rings), static_cast<ssize_t>(sizeof rings));
    EXPECT_EQ(rings, 1U);
    EXPECT_LT(::read(reader->doorbell(), &rings, sizeof rings), 0);
  }
}

TEST(FrameLog, readers_never_see_a_torn_frame_while_the_writer_laps_them) {
  FrameLog log(2048);
  constexpr std::uint32_t kFrames = 200'000;
  std::jthread writer([&] {
    for (std::uint32_t i = 0; i < kFrames; ++i) log.append(numbered(i));
  });
  const auto follow = [&] {
    FrameLog::Position position = 0;
    std::string frame;
    std::uint32_t seen = 0, last = 0;
    while (last + 1 < kFrames) {
      if (log.read(position, frame) != Outcome::frame) continue;
      const std::size_t digits = frame.find_first_of("0123456789");
      const auto number = static_cast<std::uint32_t>(std::stoul(frame.substr(digits)));
      ASSERT_EQ(frame, numbered(number));
      if (seen > 0) {
        ASSERT_GT(number, last);
      }
      last = number;
      ++seen;
    }
  };
  std::jthread one(follow), other(follow);
}

TEST(FrameLog, a_writer_that_asks_for_room_loses_nothing) {
  FrameLog log(2048);
  FrameLog::Reader reader(log);
  constexpr std::uint32_t kFrames = 50'000;
  std::jthread writer([&] {
    for (std::uint32_t i = 0; i < kFrames; ++i) {
      const std::string frame = numbered(i);
      while (!log.has_room(frame.size())) std::this_thread::yield();
      log.append(frame);
    }
  });
  std::string frame;
  for (std::uint32_t i = 0; i < kFrames;) {
    const Outcome outcome = reader.next(frame);
    ASSERT_NE(outcome, Outcome::overrun);
    if (outcome == Outcome::nothing_new) continue;
    ASSERT_EQ(frame, numbered(i));
    ++i;
  }
}

}  // namespace
}  // namespace roadvec
