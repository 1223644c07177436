#include <sys/wait.h>

#include <fstream>

#include "daemon/server/map_files.h"
#include "tests/support/map_socket.h"

namespace roadvec {
namespace {

/// A client in another language that knows the shipped roadvec.proto and nothing else.
class PythonClientTest : public MapSocket {
 protected:
  void launch() {
    const std::string command = "/usr/bin/python3 " ROADVEC_SOURCE
                                "/tests/support/python/roadvec_client.py --proto " ROADVEC_SOURCE
                                "/core/wire/roadvec.proto --socket " +
                                config_.socket_path + " --geojson " + geojson_path();
    python_ = ::popen(command.c_str(), "r");
    ASSERT_NE(python_, nullptr);
    char line[64] = "";
    ASSERT_NE(std::fgets(line, sizeof line, python_), nullptr);
    ASSERT_EQ(std::string(line), "following\n");
  }
  [[nodiscard]] int exit_status() const {
    // Its report is read to the end: it must not write into a closed pipe.
    for (char line[256]; std::fgets(line, sizeof line, python_) != nullptr;) std::printf("%s", line);
    return WEXITSTATUS(::pclose(python_));
  }
  [[nodiscard]] std::string geojson_path() const { return (folder_ / "map.geojson").string(); }
  void write_geojson(const VectorMap& map) const {
    std::ofstream(geojson_path()) << geojson_of(map, *config_.facts.anchor);
  }

  std::FILE* python_ = nullptr;
};

TEST_F(PythonClientTest, joining_late_has_the_map_and_the_geojson_to_the_millimetre) {
  start();
  publish(100);
  launch();
  publish(100);
  write_geojson(story_.map());
  stop();
  EXPECT_EQ(exit_status(), 0);
}

/// As clients_never_miss_test.cpp does, with none of its code.
TEST_F(PythonClientTest, clients_that_stall_leave_and_come_back_have_the_map_or_were_told) {
  story_ = MapStory(2, 100);
  full_frame_bytes_ = std::size_t{4} << 10;
  config_.stall_timeout_s = config_.half_frame_timeout_s = 0.3;
  config_.send_buffer_bytes = 4096;
  config_.facts.batch_bytes = 1024;
  start(std::size_t{128} << 10);
  std::jthread growing([this](std::stop_token token) {
    while (!token.stop_requested() && head_seq() < 1000) {
      publish(1);
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  });
  const std::string command = "/usr/bin/python3 " ROADVEC_SOURCE
                              "/tests/support/python/wandering_clients.py --proto " ROADVEC_SOURCE
                              "/core/wire/roadvec.proto --seconds 2 --socket " +
                              config_.socket_path;
  python_ = ::popen(command.c_str(), "r");
  ASSERT_NE(python_, nullptr);
  EXPECT_EQ(exit_status(), 0);
}

TEST_F(PythonClientTest, notices_a_geojson_that_is_off_by_a_millimetre) {
  start();
  publish(20);
  launch();
  VectorMap map = story_.map();
  map.begin()->second.vertices.front().x_m += 0.001;
  write_geojson(map);
  stop();
  EXPECT_EQ(exit_status(), 1);
}

}  // namespace
}  // namespace roadvec
