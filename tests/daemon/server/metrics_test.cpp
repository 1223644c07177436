#include "daemon/server/metrics.h"

#include <gtest/gtest.h>

#include <regex>
#include <set>

#include "tests/support/map_socket.h"

namespace roadvec {
namespace {

TEST(Metrics, are_the_status_as_open_metrics_text) {
  wire::Status status;
  status.server_version = "1.2.3";
  status.state = "wai\"ting";
  status.head_seq = 18;
  status.travelled_m = 1000.25;
  status.not_growing_reason = "no LiDAR packets";
  status.stages = {
      {"lidar", "ok", {{"received", 12'345}}, {{"rate_hz", 9.875}}, {{"decode", 1234, 7.5, 9.25, 20, 9000}}},
      {"latency", "late", {}, {}, {{"written", 5, 1500, 2500, 3000, 6500, {1, 3}}}}};
  const std::string text = open_metrics_of(status);
  for (const char* expected : {
           "# TYPE roadvec_build info\nroadvec_build_info{version=\"1.2.3\"} 1\n",
           "# TYPE roadvec_state gauge\nroadvec_state{state=\"wai\\\"ting\"} 1\n",
           "# TYPE roadvec_map_grows gauge\nroadvec_map_grows 0.000000\n",
           "# TYPE roadvec_map_changes counter\nroadvec_map_changes_total 18\n",
           "roadvec_travelled_meters 1000.250000\n",
           "# TYPE roadvec_lidar_received counter\nroadvec_lidar_received_total 12345\n",
           "# TYPE roadvec_lidar_rate_hz gauge\nroadvec_lidar_rate_hz 9.875000\n",
           "# TYPE roadvec_lidar_step_seconds summary\n"
           "roadvec_lidar_step_seconds{step=\"decode\",quantile=\"0.5\"} 0.000007500\n"
           "roadvec_lidar_step_seconds{step=\"decode\",quantile=\"0.99\"} 0.000009250\n"
           "roadvec_lidar_step_seconds_sum{step=\"decode\"} 0.009000000\n"
           "roadvec_lidar_step_seconds_count{step=\"decode\"} 1234\n"
           "# TYPE roadvec_lidar_step_longest_seconds gauge\n"
           "roadvec_lidar_step_longest_seconds{step=\"decode\"} 0.000020000\n",
           "# TYPE roadvec_stage_ok gauge\nroadvec_stage_ok{stage=\"lidar\"} 1\nroadvec_stage_ok{stage=\"latency\"} "
           "0\n",
           "# TYPE roadvec_latency_seconds histogram\n"
           "roadvec_latency_seconds_bucket{step=\"written\",le=\"0.001024\"} 1\n"
           "roadvec_latency_seconds_bucket{step=\"written\",le=\"0.002048\"} 3\n"
           "roadvec_latency_seconds_bucket{step=\"written\",le=\"+Inf\"} 5\n"
           "roadvec_latency_seconds_sum{step=\"written\"} 0.006500000\n"
           "roadvec_latency_seconds_count{step=\"written\"} 5\n",
       }) {
    EXPECT_NE(text.find(expected), std::string::npos) << expected << "is not in\n" << text;
  }
  EXPECT_TRUE(text.ends_with("\n# EOF\n"));
}

using MetricsOnTheSocket = MapSocket;

TEST_F(MetricsOnTheSocket, every_line_keeps_to_the_grammar_and_no_family_comes_twice) {
  start();
  MapClient client = connect();
  ASSERT_TRUE(client.send(wire::Subscribe{}));
  ASSERT_TRUE(client.receive_one<wire::Heartbeat>(kPatience)) << "made with the first status";
  ASSERT_TRUE(client.send(wire::GetMetrics{}));
  const auto metrics = client.receive_one<wire::Metrics>(kPatience);
  ASSERT_TRUE(metrics) << metrics.error().message;
  const std::regex type("# TYPE ([a-zA-Z_][a-zA-Z0-9_]*) (counter|gauge|info|summary|histogram)"),
      sample(R"(([a-zA-Z_][a-zA-Z0-9_]*)(\{[a-z]+="([^"\\]|\\.)*"(,[a-z]+="([^"\\]|\\.)*")*\})? -?[0-9]+(\.[0-9]+)?)");
  std::set<std::string> families;
  std::istringstream lines(metrics->text);
  std::string family;
  for (std::string line; std::getline(lines, line) && line != "# EOF";) {
    std::smatch match;
    if (std::regex_match(line, match, type)) {
      family = match[1];
      EXPECT_TRUE(families.insert(family).second) << family;
    } else {
      ASSERT_TRUE(std::regex_match(line, match, sample)) << line;
      EXPECT_TRUE(match[1].str().starts_with(family)) << line;
    }
  }
  EXPECT_TRUE(families.contains("roadvec_server_clients_connected"));
  EXPECT_TRUE(families.contains("roadvec_map_changes"));
}

}  // namespace
}  // namespace roadvec
