#include <gmock/gmock.h>
#include <sys/wait.h>

#include <fstream>
#include <sstream>

#include "daemon/server/map_files.h"
#include "tests/support/map_socket.h"

namespace roadvec {
namespace {

using ::testing::HasSubstr;

/// The program `roadvec` against a served map.
class RoadvecToolTest : public MapSocket {
 protected:
  struct Result {
    int exit_status = -1;
    std::string output;
  };
  [[nodiscard]] Result run(const std::string& arguments) const {
    const std::string command = ROADVEC_BIN "/roadvec --socket " + config_.socket_path + " " + arguments + " 2>&1";
    Result result;
    std::FILE* pipe = ::popen(command.c_str(), "r");
    for (char line[4096]; std::fgets(line, sizeof line, pipe) != nullptr;) result.output += line;
    result.exit_status = WEXITSTATUS(::pclose(pipe));
    return result;
  }
  /// Until the server has all of it.
  void serve_a_map() {
    start();
    publish(130);
    wire::MapReplica replica;
    MapClient client = connect();
    ASSERT_TRUE(client.send(wire::Subscribe{}));
    follow(client, replica, head_seq());
  }
};

TEST_F(RoadvecToolTest, says_with_its_exit_status_what_went_wrong) {
  EXPECT_EQ(run("status").exit_status, 3) << "no daemon";
  EXPECT_EQ(run("").exit_status, 2);
  EXPECT_EQ(run("status --interval 1").exit_status, 2) << "of --watch";
  EXPECT_EQ(run("tiles --area 1,2,3").exit_status, 2);
  EXPECT_EQ(run("tiles --area 3,0,1,1").exit_status, 2);
  EXPECT_EQ(run("--version").exit_status, 0);
  const Result help = run("--help");
  EXPECT_EQ(help.exit_status, 0);
  EXPECT_THAT(help.output, HasSubstr("EXIT STATUS"));
  start();
  EXPECT_EQ(run("tiles --around 50").exit_status, 1) << "no pose yet";
  EXPECT_EQ(run("render -o /missing/map.svg").exit_status, 1);
}

TEST_F(RoadvecToolTest, prints_status_tiles_and_changes) {
  start();
  publish(50);
  EXPECT_THAT(run("status").output, HasSubstr(": mapping\n"));
  EXPECT_THAT(run("status --json").output, HasSubstr(R"("state":"mapping")"));
  EXPECT_THAT(run("tiles").output, HasSubstr("vertices"));
  EXPECT_THAT(run("tiles --json --area 0,-100,60,100").output, HasSubstr(R"({"ix":0,"iy":-1,)"));
  // Until it has seen one: it may take a while to start.
  std::jthread changes([&](std::stop_token ended) {
    while (!ended.stop_requested()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      publish(2);
    }
  });
  const Result watched = run("watch --json -n 1");
  changes.request_stop();
  EXPECT_EQ(watched.exit_status, 0) << watched.output;
  EXPECT_THAT(watched.output, HasSubstr(R"("type":"snapshot")"));
  EXPECT_THAT(watched.output, HasSubstr(R"("type":"delta")"));
}

TEST_F(RoadvecToolTest, exports_in_every_format_and_the_file_says_the_same_as_the_daemon) {
  serve_a_map();
  const std::string file = (folder_ / "map.gpkg").string();
  EXPECT_EQ(run("export gpkg -o -").exit_status, 2);
  ASSERT_EQ(run("export gpkg -o " + file).exit_status, 0);
  EXPECT_EQ(run("export lanelet2").output, lanelet2_of(story_.map(), *config_.facts.anchor));
  std::ofstream(folder_ / "used.gpkg-wal") << "somebody's";
  const Result in_use = run("export gpkg -o " + (folder_ / "used.gpkg").string());
  EXPECT_EQ(in_use.exit_status, 1);
  EXPECT_THAT(in_use.output, HasSubstr("is in use"));
  std::ofstream(folder_ / "second.gpkg.part-wal") << "left by an export that was killed";
  EXPECT_EQ(run("export gpkg -o " + (folder_ / "second.gpkg").string()).exit_status, 0);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "second.gpkg.part-wal"));
  stop();
  EXPECT_EQ(run("export lanelet2 --map " + file).output, lanelet2_of(story_.map(), *config_.facts.anchor));
  EXPECT_THAT(run("export geojson --map " + file).output, HasSubstr("\"kind\":\"curb\""));
  EXPECT_THAT(run("export geojson --part 7 --map " + file).output, HasSubstr("no such part; it has 1"));
  EXPECT_EQ(run("export geojson --map /missing/map.gpkg").exit_status, 1);
  std::ofstream(folder_ / "note.txt") << "not a map";
  EXPECT_EQ(run("export geojson --map " + (folder_ / "note.txt").string()).exit_status, 1);
  EXPECT_EQ(run("export geojson --part 1").exit_status, 2);
  EXPECT_EQ(run("export gpkg -o /missing/map.gpkg --map " + file).exit_status, 1);
}

TEST_F(RoadvecToolTest, exports_the_same_geojson_as_the_daemon_and_draws_it) {
  serve_a_map();
  const std::string path = (folder_ / "map.geojson").string();
  ASSERT_EQ(run("export geojson -o " + path).exit_status, 0);
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  EXPECT_EQ(text.str(), geojson_of(story_.map(), *config_.facts.anchor));
  EXPECT_THAT(run("render -o - --title Test").output, HasSubstr("</svg>"));
}

}  // namespace
}  // namespace roadvec
