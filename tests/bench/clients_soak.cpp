// How long a change of the map takes from its publisher to a client, and what clients cost the server: one that reads,
// fifty that read, and fifty that read beside fifty that ask for everything and never read. Clients are another
// process.
//
//   soak_clients [SECONDS]      each of the four; default 30 s at 100 changes a second, ten times those of a car

#include <poll.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <protozero/pbf_reader.hpp>
#include <thread>

#include "daemon/server/client.h"
#include "daemon/server/map_server.h"
#include "tests/support/map_story.h"
#include "tests/support/temporary_folder.h"

namespace roadvec {
namespace {

constexpr double kChanges_hz = 100;
constexpr MapClient::Seconds kPatience{20};

std::int64_t now_ns() { return std::chrono::steady_clock::now().time_since_epoch().count(); }

double resident_mb() {
  std::ifstream file("/proc/self/status");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("VmRSS:")) return std::atof(line.c_str() + 6) / 1024;
  }
  return 0;
}

struct Latencies {
  std::uint64_t count = 0;
  double p50_us = 0, p99_us = 0, max_us = 0;
  std::uint64_t dismissed_count = 0;
};

/// The process of the clients: follows with all readers until the server says Bye.
class Crowd {
 public:
  Crowd(std::string path, int reader_count, int stuck_count) : path_(std::move(path)) {
    while (true) {
      Expected<MapClient> first = MapClient::open(path_);
      if (first) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    for (int i = 0; i < reader_count; ++i) readers_.emplace_back(subscribed(false));
    for (int i = 0; i < stuck_count; ++i) stuck_.push_back(subscribed(i % 2 == 0));
  }
  Latencies follow() {
    while (!over_ && !(readers_.empty() && stuck_.empty())) {
      std::vector<pollfd> polled;
      for (const Reader& reader : readers_) polled.push_back({reader.client.fd(), POLLIN, 0});
      for (const MapClient& client : stuck_) polled.push_back({client.fd(), POLLHUP, 0});
      ::poll(polled.data(), polled.size(), 1000);
      for (std::size_t i = 0; i < readers_.size(); ++i) {
        if (polled[i].revents != 0) read(readers_[i]);
      }
      for (std::size_t i = 0; i < stuck_.size(); ++i) {
        if (polled[readers_.size() + i].revents == 0) continue;
        Expected<MapClient> again = MapClient::open(path_);
        over_ = over_ || !again;  // the server is gone
        if (over_) break;
        ++dismissed_count_;
        stuck_[i] = subscribed(i % 2 == 0);
      }
    }
    return summary();
  }

 private:
  struct Reader {
    explicit Reader(MapClient c) : client(std::move(c)) {}
    MapClient client;
    wire::FrameAssembler input{wire::kMostServerBytes};
  };

  MapClient subscribed(bool asks_for_tiles) {
    Expected<MapClient> client = MapClient::connect(path_, "crowd", kPatience);
    if (!client) ::_exit(1);
    if (asks_for_tiles) (void)client->send(wire::GetTiles{});
    (void)client->send(wire::Subscribe{});
    return std::move(*client);
  }
  void read(Reader& reader) {
    const std::span<char> space = reader.input.space();
    const ssize_t count = ::read(reader.client.fd(), space.data(), space.size());
    if (count <= 0) {
      over_ = true;
      return;
    }
    reader.input.received(static_cast<std::size_t>(count));
    const std::int64_t here_ns = now_ns();
    while (const auto envelope = reader.input.next()) {
      // No more than the time: decoding all of it fifty times would be the client's time, not the server's.
      protozero::pbf_reader message(envelope->data(), envelope->size());
      if (!message.next(10)) continue;
      protozero::pbf_reader delta = message.get_message();
      if (delta.next(3)) latencies_ns_.push_back(here_ns - delta.get_sfixed64());  // absent: from before they came
    }
  }
  Latencies summary() {
    std::ranges::sort(latencies_ns_);
    const auto quantile_us = [&](double share) {
      const auto i = static_cast<std::size_t>(share * static_cast<double>(latencies_ns_.size() - 1));
      return static_cast<double>(latencies_ns_[i]) * 1e-3;
    };
    if (latencies_ns_.empty()) return {0, 0, 0, 0, dismissed_count_};
    return {latencies_ns_.size(), quantile_us(0.5), quantile_us(0.99), quantile_us(1), dismissed_count_};
  }

  std::string path_;
  std::vector<Reader> readers_;
  std::vector<MapClient> stuck_;
  std::vector<std::int64_t> latencies_ns_;
  std::uint64_t dismissed_count_ = 0;
  bool over_ = false;
};

struct Measured {
  Latencies latencies;
  double grown_mb = 0, published_max_us = 0;
  double cpu_share = 0;  ///< of one processor: server and publisher
};

double cpu_s() {
  timespec now{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

template <class Wait>
Measured serve(double seconds, const std::string& path, Wait&& wait_for_clients) {
  FrameLog log(std::size_t{16} << 20);
  MapStory story(1, 40);
  MapPublisher publisher(log, {1, 0});
  Latest<PoseReport> poses;
  MapServerConfig config;
  config.socket_path = path;
  config.start = {1, 0};
  config.most_clients = config.most_clients_per_user = 200;
  double published_max_us = 0;
  const auto publish = [&](std::int64_t time_ns) {
    MapChange change = story.step();
    change.time.ns = time_ns;
    publisher.publish(change, story.map(), [&](std::size_t bytes) {
      while (!log.has_room(bytes)) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    });
    if (time_ns != 0) published_max_us = std::max(published_max_us, static_cast<double>(now_ns() - time_ns) * 1e-3);
  };
  MapServer server(config, log, poses, [] { return wire::Status{}; });
  std::jthread thread([&](std::stop_token token) { (void)server.run(token); });
  for (int i = 0; i < 2000; ++i) publish(0);  // before anybody looks: 6 km
  wait_for_clients();
  std::this_thread::sleep_for(std::chrono::seconds(1));
  const double begin_mb = resident_mb();
  const double begin_cpu_s = cpu_s();
  double most_mb = begin_mb;
  const std::int64_t begin_ns = now_ns();
  for (std::int64_t i = 0; static_cast<double>(now_ns() - begin_ns) < seconds * 1e9; ++i) {
    publish(now_ns());
    if (i % 50 == 0) most_mb = std::max(most_mb, resident_mb());
    std::this_thread::sleep_until(std::chrono::steady_clock::time_point(std::chrono::nanoseconds(
        begin_ns + static_cast<std::int64_t>(static_cast<double>(i + 1) * 1e9 / kChanges_hz))));
  }
  return {{}, most_mb - begin_mb, published_max_us, (cpu_s() - begin_cpu_s) / seconds};
}

/// Clients in a process of their own, which says when they are all there, and at last what they have seen.
struct Crowded {
  Crowded(const std::string& path, int reader_count, int stuck_count) {
    if (::pipe(ends) != 0) std::abort();
    pid = ::fork();
    if (pid != 0) return;
    Crowd crowd(path, reader_count, stuck_count);
    if (::write(ends[1], "", 1) != 1) ::_exit(1);
    const Latencies latencies = crowd.follow();
    ::_exit(::write(ends[1], &latencies, sizeof latencies) == static_cast<ssize_t>(sizeof latencies) ? 0 : 1);
  }
  template <class T>
  T take() const {
    T value{};
    if (::read(ends[0], &value, sizeof value) != static_cast<ssize_t>(sizeof value)) std::abort();
    return value;
  }
  ~Crowded() {
    ::waitpid(pid, nullptr, 0);
    ::close(ends[0]);
    ::close(ends[1]);
  }
  int ends[2]{};
  pid_t pid = 0;
};

Measured run(int reader_count, int stuck_count, double seconds) {
  const TemporaryFolder folder;
  const std::string path = (folder / "map.sock").string();
  const Crowded readers(path, reader_count, 0), stuck(path, 0, stuck_count);
  Measured measured = serve(seconds, path, [&] {
    (void)readers.take<char>();
    (void)stuck.take<char>();
  });
  measured.latencies = readers.take<Latencies>();
  measured.latencies.dismissed_count = stuck.take<Latencies>().dismissed_count;
  return measured;
}

void print(const char* who, const Measured& m) {
  std::printf("%-36s %8llu %9.0f %9.0f %9.0f %10.2f %12.0f %6.1f %10llu\n", who,
              static_cast<unsigned long long>(m.latencies.count), m.latencies.p50_us, m.latencies.p99_us,
              m.latencies.max_us, m.grown_mb, m.published_max_us, 100 * m.cpu_share,
              static_cast<unsigned long long>(m.latencies.dismissed_count));
  std::fflush(stdout);
}

int soak(double seconds) {
  std::printf("%-36s %8s %9s %9s %9s %10s %12s %6s %10s\n", "clients", "changes", "p50 us", "p99 us", "max us",
              "grown MB", "publish us", "cpu %", "dismissed");
  std::fflush(stdout);
  const Measured one = run(1, 0, seconds);
  print("1 that reads", one);
  const Measured reading = run(50, 0, seconds);
  print("50 that read", reading);
  const Measured stuck = run(1, 50, seconds);
  print("1 that reads, 50 that never do", stuck);
  const Measured all = run(50, 50, seconds);
  print("50 that read, 50 that never do", all);
  std::printf("p99: 50 stuck beside 1: %.2f x; 50 beside 50 that read: %.2f x; all 100 against 1: %.2f x\n",
              stuck.latencies.p99_us / one.latencies.p99_us, all.latencies.p99_us / reading.latencies.p99_us,
              all.latencies.p99_us / one.latencies.p99_us);
  return 0;
}

}  // namespace
}  // namespace roadvec

int main(int argc, char** argv) { return roadvec::soak(argc > 1 ? std::atof(argv[1]) : 30); }
