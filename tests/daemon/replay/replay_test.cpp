#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <thread>

namespace roadvec {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using ::testing::HasSubstr;
using ::testing::Not;
using Bytes = std::vector<unsigned char>;

constexpr int kPacketCount = 20;
constexpr double kPacketSpacing_s = 0.02;

std::string text_of(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

/// A capture of UDP datagrams in nanoseconds.
class Capture {
 public:
  explicit Capture(const fs::path& file) : out_(file, std::ios::binary) {
    for (const std::uint32_t word : {0xa1b23c4dU, 0x00040002U, 0U, 0U, 65535U, 1U}) little(word);
  }
  void add(double time_s, std::uint16_t port, const Bytes& payload, std::uint8_t sender = 201) {
    const auto size = static_cast<std::uint16_t>(payload.size());
    const double whole_s = std::floor(time_s);
    little(static_cast<std::uint32_t>(whole_s));
    little(static_cast<std::uint32_t>(std::lround((time_s - whole_s) * 1e9)));
    little(size + 42U);
    little(size + 42U);
    out_.write("\0\0\0\0\0\0\0\0\0\0\0\0\x08\0", 14);
    const auto word = [this](unsigned value) { out_.put(static_cast<char>(value >> 8)).put(static_cast<char>(value)); };
    word(0x4500), word(size + 28U), word(0), word(0), word(0x4011), word(0), word(192U << 8 | 168U),
        word(1U << 8 | sender), word(0), word(0);
    word(port), word(port), word(size + 8U), word(0);
    out_.write(reinterpret_cast<const char*>(payload.data()), size);
  }

 private:
  void little(std::uint32_t value) { out_.write(reinterpret_cast<const char*>(&value), 4); }
  std::ofstream out_;
};

Bytes packet(int number) {
  Bytes bytes(1206, 0x5a);
  bytes[0] = static_cast<unsigned char>(number);
  return bytes;
}

class UdpPort {
 public:
  UdpPort() : fd_(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0)) {
    const int size = 1 << 20;
    ::setsockopt(fd_, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address_;
    if (::bind(fd_, reinterpret_cast<sockaddr*>(&address_), length) != 0) std::abort();
    ::getsockname(fd_, reinterpret_cast<sockaddr*>(&address_), &length);
  }
  ~UdpPort() { ::close(fd_); }
  UdpPort(const UdpPort&) = delete;
  UdpPort& operator=(const UdpPort&) = delete;

  std::string port() const { return std::to_string(ntohs(address_.sin_port)); }
  std::string endpoint() const { return "127.0.0.1:" + port(); }
  std::vector<Bytes> received() const {
    std::vector<Bytes> all;
    Bytes datagram(2000);
    for (ssize_t size = 0; (size = ::recv(fd_, datagram.data(), datagram.size(), 0)) >= 0;) {
      all.emplace_back(datagram.begin(), datagram.begin() + size);
    }
    return all;
  }

 private:
  int fd_;
  sockaddr_in address_{};
};

/// A drive of 0.4 s: 20 packets, 40 CAN frames, 8 IMU messages, and what is not for the LiDAR's socket.
class Replay : public ::testing::Test {
 protected:
  static constexpr double kStart_s = 1317042272.0;

  Replay() {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    std::ofstream(folder_ / "drive.toml") << R"(source = "made by hand"
[lidar]
model = "VLP-16"
pcap = "lidar.pcap"
source_address = "192.168.1.201"
x_m = 0.0
y_m = 0.0
z_m = 1.8
roll_deg = 0.0
pitch_deg = 0.0
yaw_deg = 0.0
[vehicle]
wheelbase_m = 2.7
track_m = 1.5
steering_ratio = 15.0
can = "can.log"
dbc = "vehicle.dbc"
steering_signal = "S.A"
wheel_speed_signals = ["W.V"]
[imu]
protocol = "xsens"
log = "imu.log"
roll_deg = 0.0
pitch_deg = 0.0
yaw_deg = 0.0
)";
    std::ofstream(folder_ / "vehicle.dbc") << "VERSION \"\"\n";
    Capture capture(folder_ / "lidar.pcap");
    for (int i = 0; i < kPacketCount; ++i) capture.add(kStart_s + i * kPacketSpacing_s, 2368, packet(i));
    capture.add(kStart_s + 0.381, 8308, Bytes(512, 0x47));
    capture.add(kStart_s + 0.382, 5555, Bytes(100, 1));    // other traffic
    capture.add(kStart_s + 0.383, 2368, packet(99), 202);  // another sensor
    std::ofstream can(folder_ / "can.log");
    for (int i = 0; i < 40; ++i) {
      char line[64];
      std::snprintf(line, sizeof line, "(%.6f) can0 0C2#%04X0000\n", kStart_s + 0.005 + i * 0.01, i);
      can << line;
    }
    can << "(1317042272.396000) can0 20000004#0000000000000000\nno frame\n";  // an error frame, and damage
    std::ofstream imu(folder_ / "imu.log");
    for (int i = 0; i < 8; ++i)
      imu << "(" << static_cast<long>(kStart_s) << "." << i * 50 / 100 << i * 50 % 100 / 10 << "0) faff3600" << i
          << "a0d\n";
  }
  ~Replay() override { fs::remove_all(folder_); }

  struct Result {
    int status = -1;
    std::string out, err;
    double taken_s = 0;
  };
  /// Runs the program; `meanwhile` is called again and again with its process until it ends.
  Result run(std::vector<std::string> arguments, const std::function<void(pid_t)>& meanwhile = {}) const {
    const std::string program = std::string(ROADVEC_BIN) + "/roadvec-replay";
    arguments.insert(arguments.begin(), program);
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    const fs::path out = folder_ / "out.txt", err = folder_ / "err.txt";
    posix_spawn_file_actions_t files;
    ::posix_spawn_file_actions_init(&files);
    ::posix_spawn_file_actions_addopen(&files, 1, out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    ::posix_spawn_file_actions_addopen(&files, 2, err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    pid_t child = 0;
    const auto begun = std::chrono::steady_clock::now();
    EXPECT_EQ(::posix_spawn(&child, program.c_str(), &files, nullptr, argv.data(), environ), 0) << program;
    ::posix_spawn_file_actions_destroy(&files);
    Result result;
    int status = 0;
    while (::waitpid(child, &status, WNOHANG) == 0) {
      if (meanwhile) meanwhile(child);
      std::this_thread::sleep_for(1ms);
    }
    result.taken_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    result.status = WIFEXITED(status) ? WEXITSTATUS(status) : 1000 + WTERMSIG(status);
    result.out = text_of(out);
    result.err = text_of(err);
    return result;
  }
  std::string drive() const { return folder_.native(); }
  fs::path path(const char* name) const { return folder_ / name; }

  const fs::path folder_ =
      fs::path(::testing::TempDir()) /
      ("roadvec_replay_" + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
};

TEST_F(Replay, packets_arrive_whole_in_order_and_on_time) {
  const UdpPort data, position;
  const Result result = run({drive(), "--udp", data.endpoint(), "--position-port", position.port()});
  EXPECT_EQ(result.status, 0) << result.err;
  const auto received = data.received();
  ASSERT_EQ(received.size(), static_cast<std::size_t>(kPacketCount));
  for (int i = 0; i < kPacketCount; ++i) EXPECT_EQ(received[static_cast<std::size_t>(i)], packet(i));
  EXPECT_EQ(position.received(), std::vector<Bytes>{Bytes(512, 0x47)});
  EXPECT_GE(result.taken_s, 0.38);
  EXPECT_LT(result.taken_s, 10.0);
  EXPECT_THAT(result.out, HasSubstr("playing " + drive() + " at 1 times its speed"));
  EXPECT_THAT(result.out, HasSubstr("can    not played"));
  EXPECT_THAT(result.out, HasSubstr("21 sent         24632 bytes         0 lost         2 skipped"));
}

TEST_F(Replay, speed_scales_time) {
  const UdpPort data;
  const Result slow = run({drive(), "--udp", data.endpoint(), "--position-port", "0", "--speed", "0.5"});
  EXPECT_EQ(slow.status, 0) << slow.err;
  EXPECT_GE(slow.taken_s, 0.76);
  EXPECT_EQ(data.received().size(), static_cast<std::size_t>(kPacketCount));
  const Result fast =
      run({drive(), "--udp", data.endpoint(), "--position-port", "0", "--as-fast-as-possible", "--json"});
  EXPECT_EQ(fast.status, 0) << fast.err;
  EXPECT_THAT(fast.out, HasSubstr("\"speed\": null"));
  EXPECT_LT(fast.taken_s, 0.38);
  EXPECT_EQ(data.received().size(), static_cast<std::size_t>(kPacketCount));
}

TEST_F(Replay, a_stretch_is_counted_from_the_first_stamp) {
  const UdpPort data;
  const Result result = run({drive(), "--udp", data.endpoint(), "--from", "0.095", "--to", "0.205"});
  EXPECT_EQ(result.status, 0) << result.err;
  const auto received = data.received();
  ASSERT_EQ(received.size(), 6U);  // at 0.10, 0.12 .. 0.20
  EXPECT_EQ(received.front(), packet(5));
  EXPECT_EQ(received.back(), packet(10));
  const Result nothing = run({drive(), "--udp", data.endpoint(), "--from", "50"});
  EXPECT_EQ(nothing.status, 1);
  EXPECT_THAT(nothing.err, HasSubstr("nothing to play between --from and --to"));
}

TEST_F(Replay, can_frames_reach_a_pipe_with_the_date_of_today) {
  const UdpPort data;
  ASSERT_EQ(::mkfifo(path("can.fifo").c_str(), 0600), 0);
  const int fifo = ::open(path("can.fifo").c_str(), O_RDONLY | O_NONBLOCK);
  const Result result = run({drive(), "--udp", data.endpoint(), "--can-pipe", path("can.fifo"), "--json"});
  EXPECT_EQ(result.status, 0) << result.err;
  std::string text(65536, '\0');
  text.resize(static_cast<std::size_t>(std::max<ssize_t>(0, ::read(fifo, text.data(), text.size()))));
  ::close(fifo);
  std::istringstream lines(text);
  double first_s = 0;
  int count = 0;
  for (std::string line; std::getline(lines, line); ++count) {
    double stamp_s = 0;
    char frame[40] = "";
    ASSERT_EQ(std::sscanf(line.c_str(), "(%lf) can0 %39s", &stamp_s, frame), 2) << line;
    char expected[40];
    std::snprintf(expected, sizeof expected, "0C2#%04X0000", count);
    EXPECT_STREQ(frame, expected);
    if (count == 0) first_s = stamp_s;
    EXPECT_NEAR(stamp_s - first_s, count * 0.01, 2e-3);
  }
  EXPECT_EQ(count, 40);
  EXPECT_NEAR(first_s, static_cast<double>(::time(nullptr)), 60.0);
  EXPECT_THAT(result.out,
              HasSubstr("{\"name\": \"can\", \"to\": \"" + path("can.fifo").native() + "\", \"sent_count\": 40"));
  EXPECT_THAT(result.out, HasSubstr("\"lost_count\": 0, \"skipped_count\": 2"));
  EXPECT_TRUE(fs::exists(path("can.fifo"))) << "it was there before";
}

TEST_F(Replay, the_imu_speaks_on_a_terminal_once_somebody_listens) {
  const UdpPort data;
  int line = -1;
  std::string heard;
  bool waited = false;
  const Result result = run({drive(), "--udp", data.endpoint(), "--imu-pty", path("imu")}, [&](pid_t) {
    if (line < 0 && fs::exists(path("imu"))) {
      std::this_thread::sleep_for(100ms);
      waited = data.received().empty();
      line = ::open(path("imu").c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY);
    }
    char bytes[256];
    const ssize_t size = line < 0 ? 0 : ::read(line, bytes, sizeof bytes);
    if (size > 0) heard.append(bytes, static_cast<std::size_t>(size));
  });
  ::close(line);
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_TRUE(waited);
  EXPECT_THAT(result.out, HasSubstr("waiting until " + path("imu").native()));
  std::string expected;
  for (int i = 0; i < 8; ++i) expected += std::string("\xfa\xff\x36\x00", 4) + static_cast<char>(i << 4 | 0xa) + '\x0d';
  EXPECT_EQ(heard, expected) << "raw: no byte may be translated";
  EXPECT_FALSE(fs::is_symlink(path("imu")));
}

TEST_F(Replay, the_imu_speaks_in_datagrams) {
  const UdpPort data, imu;
  EXPECT_EQ(run({drive(), "--udp", data.endpoint(), "--imu-udp", imu.endpoint(), "--speed", "4"}).status, 0);
  const auto received = imu.received();
  ASSERT_EQ(received.size(), 8U);
  EXPECT_EQ(received[3], (Bytes{0xfa, 0xff, 0x36, 0x00, 0x3a, 0x0d}));
}

TEST_F(Replay, a_loop_goes_on_until_a_signal_and_leaves_nothing_behind) {
  const UdpPort data;
  int fifo = -1;
  std::size_t count = 0;
  const Result result = run(
      {drive(), "--udp", data.endpoint(), "--can-pipe", path("made.fifo"), "--loop", "--speed", "4"}, [&](pid_t child) {
        if (fifo < 0) fifo = ::open(path("made.fifo").c_str(), O_RDONLY | O_NONBLOCK);
        count += data.received().size();
        if (count > 2 * kPacketCount) ::kill(child, SIGTERM);
      });
  ::close(fifo);
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("interrupted: "));
  EXPECT_FALSE(fs::exists(path("made.fifo")));
}

TEST_F(Replay, a_signal_ends_the_wait_for_a_reader) {
  const UdpPort data;
  const Result result = run({drive(), "--udp", data.endpoint(), "--can-pipe", path("made.fifo")}, [&](pid_t child) {
    if (text_of(path("out.txt")).find("waiting") != std::string::npos) ::kill(child, SIGINT);
  });
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_TRUE(data.received().empty());
}

TEST_F(Replay, what_nobody_takes_is_counted_as_lost) {
  std::string port;
  {
    const UdpPort closed_again;
    port = closed_again.port();
  }
  const Result result = run({drive(), "--udp", "127.0.0.1:" + port, "--position-port", "0", "--json"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_THAT(result.out, Not(HasSubstr("\"lost_count\": 0")));
}

TEST_F(Replay, a_cut_capture_is_played_up_to_there_and_told) {
  const UdpPort data;
  fs::resize_file(path("lidar.pcap"), 24 + 5 * (16 + 42 + 1206) + 700);
  const Result result = run({drive(), "--udp", data.endpoint(), "--speed", "4"});
  EXPECT_EQ(result.status, 0) << result.err;
  EXPECT_EQ(data.received().size(), 5U);
  EXPECT_THAT(result.out, HasSubstr("lidar.pcap: cut off inside its last record"));
}

TEST_F(Replay, errors_end_with_status_1_and_name_the_remedy) {
  const UdpPort data;
  const Result no_can = run({drive(), "--udp", data.endpoint(), "--can", "nosuchcan0"});
  EXPECT_EQ(no_can.status, 1);
  EXPECT_THAT(no_can.err, ::testing::AnyOf(HasSubstr("run without --can"), HasSubstr("no such interface")));
  const Result no_drive = run({path("nowhere")});
  EXPECT_EQ(no_drive.status, 1);
  EXPECT_THAT(no_drive.err, HasSubstr("drive.toml: cannot read: No such file"));
  const Result no_fifo = run({drive(), "--udp", data.endpoint(), "--can-pipe", path("drive.toml")});
  EXPECT_EQ(no_fifo.status, 1);
  EXPECT_THAT(no_fifo.err, HasSubstr("is there and not a FIFO"));
  const Result no_link = run({drive(), "--udp", data.endpoint(), "--imu-pty", path("drive.toml")});
  EXPECT_EQ(no_link.status, 1);
  EXPECT_THAT(no_link.err, HasSubstr("is there and not a symbolic link"));
  std::ofstream(path("lidar.pcap")) << "no capture";
  const Result no_pcap = run({drive(), "--udp", data.endpoint()});
  EXPECT_EQ(no_pcap.status, 1);
  EXPECT_THAT(no_pcap.err, HasSubstr("not a pcap that can be read"));
}

TEST_F(Replay, wrong_command_lines_end_with_status_2) {
  EXPECT_EQ(run({}).status, 2);
  EXPECT_EQ(run({drive(), "--sped", "1"}).status, 2);
  EXPECT_EQ(run({drive(), "--speed", "0"}).status, 2);
  EXPECT_EQ(run({drive(), "--speed", "2", "--as-fast-as-possible"}).status, 2);
  EXPECT_EQ(run({drive(), "--from", "2", "--to", "1"}).status, 2);
  const Result result = run({drive(), "--udp", "localhost"});
  EXPECT_EQ(result.status, 2);
  EXPECT_THAT(result.err, HasSubstr("'localhost' is not HOST:PORT"));
}

TEST_F(Replay, help_and_version_tell_what_there_is) {
  const Result help = run({"--help"});
  EXPECT_EQ(help.status, 0);
  for (const char* part :
       {"--udp HOST:PORT", "--can-pipe PATH", "--imu-pty PATH", "--speed X", "EXAMPLES", "EXIT STATUS"}) {
    EXPECT_THAT(help.out, HasSubstr(part));
  }
  const Result version = run({"--version"});
  EXPECT_EQ(version.status, 0);
  EXPECT_THAT(version.out, ::testing::StartsWith("roadvec-replay "));
}

}  // namespace
}  // namespace roadvec
