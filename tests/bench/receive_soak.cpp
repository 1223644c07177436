// How long the receive path holds a rate without a drop: an HDL-64E S3 in dual mode sends over loopback, what comes is
// decoded and cut into sweeps as in the daemon's lidar thread.
//
//   soak_receive [SECONDS [TIMES_THE_RATE]]      default: 600 s at 3 times the 5787 packets a second
//
// Exit status 1: packets were lost.

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "drivers/velodyne/udp_receiver.h"
#include "tests/drivers/velodyne/packets.h"

namespace roadvec {
namespace {

constexpr double kRate_hz = 1e6 / 172.8;
constexpr int kBurst = 16;  // packets that leave together: the timer is no finer

/// Takes every sweep and drops it.
class Sink final : public SweepSink {
 public:
  Sink() { sweep_.returns.reserve(max_returns_per_sweep(LidarModel::hdl64e_s3)); }
  Sweep* claim() noexcept override { return &sweep_; }
  void publish() noexcept override { ++count; }
  std::uint64_t count = 0;

 private:
  Sweep sweep_;
};

double now_s(clockid_t clock) {
  timespec now{};
  ::clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Sends at the rate until the time is over; returns how many.
std::uint64_t send_packets(int port, double seconds, double rate_hz) {
  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(static_cast<std::uint16_t>(port));
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  FakeHead head(LidarModel::hdl64e_s3);
  head.dual = true;
  std::uint64_t sent = 0;
  const double begin_s = now_s(CLOCK_MONOTONIC);
  for (double at_s = 0; at_s < seconds; at_s = now_s(CLOCK_MONOTONIC) - begin_s) {
    const auto due = static_cast<std::uint64_t>(at_s * rate_hz);
    for (int i = 0; i < kBurst && sent < due; ++i, ++sent) {
      const RawPacket packet = head.next();
      if (::sendto(fd, packet.bytes.data(), packet.bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to) <
          0) {
        std::perror("sendto");
        std::exit(1);
      }
    }
    if (sent >= due) ::usleep(200);
  }
  ::close(fd);
  return sent;
}

int soak(double seconds, double times) {
  LidarCounters counters;
  auto receiver = UdpReceiver::open({.port = 0}, counters);
  if (!receiver) {
    std::fprintf(stderr, "soak_receive: %s\n", receiver.error().message.c_str());
    return 1;
  }
  Calibration calibration;
  calibration.lasers.resize(64);
  Sink sink;
  SweepDecoder decoder(LidarModel::hdl64e_s3, calibration, {}, sink, counters);
  std::atomic<bool> over{false};
  double cpu_s = 0, longest_s = 0;
  std::thread reading([&] {
    std::span<const RawPacket> batch;
    double last_s = now_s(CLOCK_MONOTONIC);
    while (true) {
      const ReadResult result = (*receiver)->read(batch, std::chrono::milliseconds(50));
      if (result == ReadResult::quiet && over.load()) break;
      for (const RawPacket& packet : batch) decoder.add(packet);
      const double here_s = now_s(CLOCK_MONOTONIC);
      longest_s = std::max(longest_s, here_s - last_s);
      last_s = here_s;
    }
    cpu_s = now_s(CLOCK_THREAD_CPUTIME_ID);
  });
  const std::uint64_t sent = send_packets((*receiver)->port(), seconds, times * kRate_hz);
  over.store(true);
  reading.join();
  const LidarCounts counts = snapshot(counters);
  std::printf(
      "%.0f s at %.1f x %.0f packets/s: %llu sent, %llu received, %llu dropped by the kernel, %llu gaps in the "
      "sensor's time, "
      "%llu sweeps\nreading and decoding took %.1f %% of a core; longest time between two reads %.1f ms; receive "
      "buffer %.1f MB\n",
      seconds, times, kRate_hz, static_cast<unsigned long long>(sent), static_cast<unsigned long long>(counts.received),
      static_cast<unsigned long long>(counts.kernel_drops), static_cast<unsigned long long>(counts.device_time_gaps),
      static_cast<unsigned long long>(sink.count), 100 * cpu_s / seconds, 1e3 * longest_s,
      (*receiver)->receive_buffer_bytes() * 1e-6);
  return counts.received == sent ? 0 : 1;
}

}  // namespace
}  // namespace roadvec

int main(int argc, char** argv) {
  return roadvec::soak(argc > 1 ? std::atof(argv[1]) : 600, argc > 2 ? std::atof(argv[2]) : 3);
}
