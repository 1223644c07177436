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
