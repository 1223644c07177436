#include "daemon/health.h"

#include <fmt/format.h>

namespace roadvec {
namespace {

constexpr double kSilent_s = 1;       // ten sweeps, a hundred messages
constexpr double kLeastShare = 0.01;  // of the packets: less is a hiccup, and counted all the same
constexpr double kNoiseShare = 0.1;   // of the port's packets, that are not the sensor's
constexpr const char* kLidarRemedy = "check its power and cable, the address it sends to, lidar.port and the firewall";
constexpr const char* kNoneOfTheSensor =
    ", but none is a data packet of the configured sensor: check lidar.model, lidar.port and lidar.source_address";

bool is_silent(const std::optional<double>& age_s) { return !age_s || *age_s > kSilent_s; }

/// Nothing usable comes of it; `what` should.
Health quiet(const std::optional<double>& age_s, const std::string& what, const char* remedy) {
  if (!age_s) return {"waiting", fmt::format("no {}: {}", what, remedy)};
  return {"silent", fmt::format("no {} for {:.1f} s: {}", what, *age_s, remedy)};
}

const char* name_of(MotionSource source) {
  switch (source) {
    case MotionSource::none:
      return "none";
    case MotionSource::matching:
      return "matching";
    case MotionSource::steering:
      return "steering";
    case MotionSource::imu:
      return "imu";
    case MotionSource::wheels:
      return "wheels";
  }
  return "none";
}

std::string from(const std::string& senders) { return senders.empty() ? "" : " from " + senders; }

}  // namespace

Health stuck() { return {"stuck", "its thread has not turned for two seconds: systemd starts the daemon again"}; }

Health health_of(const LidarFacts& f) {
  const double sent_hz = f.good_hz + f.missing_hz;
  if (is_silent(f.age_s)) {
    const bool noise = f.age_s ? f.noise_hz > 0 : f.noise_count > 0;
    return noise ? Health{"unreadable", "datagrams come" + from(f.senders) + kNoneOfTheSensor}
                 : quiet(f.age_s, "LiDAR packets on the port", kLidarRemedy);
  }
  if (f.good_hz == 0 && f.noise_hz > 0) return {"unreadable", "datagrams come" + from(f.senders) + kNoneOfTheSensor};
  if (f.awaits_calibration)
    return {"uncalibrated", "the calibration that the sensor streams is not complete yet: it takes a minute"};
  if (f.revolution_count == 0 || (f.good_hz > 0 && f.revolutions_hz == 0))
    return {"incomplete", "packets come, but no whole revolution: does the head turn?"};
  if (f.ambiguous) return {"ambiguous", "the first of " + f.senders + " is taken: set lidar.source_address"};
  if (f.missing_hz > kLeastShare * sent_hz) {
    return {"losing", fmt::format("{:.1f} % of the packets are missing: kernel_drops are ours (processor, receive "
                                  "buffer), others the network's",
                                  100 * f.missing_hz / sent_hz)};
  }
  if (f.disordered_hz > kLeastShare * sent_hz) {
    return {"disordered", fmt::format("{:.1f} % of the packets come twice or too late, and are dropped: is there one "
                                      "way through the network?",
                                      100 * f.disordered_hz / sent_hz)};
  }
  if (f.noise_hz > kNoiseShare * sent_hz)
    return {"flooded",
            fmt::format("{:.0f} datagrams a second on the port are not the sensor's: who sends them?", f.noise_hz)};
  return {"ok", fmt::format("{:.0f} packets/s", f.good_hz)};
}

Health health_of(const CanFacts& f) {
  switch (f.state) {
    case CanState::working:
      break;
    case CanState::bus_off:
      return {"bus-off",
              "CAN controller is bus-off: check bit rate and wiring; 'ip link set IFACE type can restart-ms 100' "
              "restarts it by itself, '... type can restart' once"};
    case CanState::down:
      return {"down", "CAN interface is down: 'ip link set IFACE up'"};
    case CanState::lost:
      return {"lost", "CAN interface has gone: it is opened again when one of its name is back"};
  }
  if (is_silent(f.age_s)) {
    if (f.frames_hz > 0)
      return {"unreadable", "frames come, but no value of the configured signals: check the DBC file and the signals"};
    return quiet(f.age_s, "frames of the configured signals", "check ignition, wiring and bit rate");
  }
  if (f.lost_hz > 0)
    return {"losing", fmt::format("{:.0f} frames a second are lost: the processor is too busy", f.lost_hz)};
  return {"ok", fmt::format("{:.0f} frames/s", f.frames_hz)};
}

Health health_of(const ImuFacts& f) {
  if (f.device_is_lost) return {"lost", "the IMU's device has gone: it is opened again when it is back"};
  if (is_silent(f.age_s)) {
    if (f.bytes_hz > 0)
      return {"unreadable", "bytes come, but no messages: check imu.protocol, imu.baud and the wiring"};
    return quiet(f.age_s, "messages of the IMU", "check its power and cable, and whether it is set to measure");
  }
  if (f.bad_hz > kLeastShare * (f.samples_hz + f.bad_hz)) {
    return {"losing",
            fmt::format("{:.1f} messages a second are damaged or missing: check cable and baud rate", f.bad_hz)};
  }
  return {"ok", fmt::format("{:.0f} bytes/s", f.bytes_hz)};
}

Health health_of(const MappingFacts& f) {
  if (is_silent(f.age_s)) return {"waiting", "there are no sweeps to map"};
  if (f.refused_hz > 0)
    return {"behind",
            fmt::format("{:.1f} sweeps a second are refused: the processor is too slow or too busy", f.refused_hz)};
  if (f.speed == MotionSource::none) return {"motionless", "no motion: neither wheel speed nor a match"};
  return {"ok", fmt::format("speed from {}, yaw from {}{}", name_of(f.speed), name_of(f.yaw),
                            f.matched ? "" : "; the last sweep matches nothing")};
}

}  // namespace roadvec
