#include "daemon/gps_anchor.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <csignal>

#include "drivers/velodyne/sensor_clock.h"
#include "drivers/velodyne/start_fix.h"

namespace roadvec {
namespace {

constexpr const char* kRemedy = "give the start fix in [anchor] (latitude_deg, longitude_deg, height_m, yaw_deg)";
constexpr std::chrono::milliseconds kTurn{200};

AnchorSettings settings_from(const StartFix& fix) {
  const double height_m = fix.height_m.value_or(0);
  spdlog::info("anchor from the sensor's GPS: {:.6f} N, {:.6f} E, {:.1f} m, yaw {:.1f} degrees", fix.latitude_deg,
               fix.longitude_deg, height_m, fix.yaw_deg);
  if (!fix.height_m) spdlog::warn("the GPS receiver tells no height (no GGA sentences): the anchor's is 0");
  return {fix.latitude_deg, fix.longitude_deg, height_m, fix.yaw_deg};
}

std::string waiting_text(const SensorClockReport& gps) {
  if (gps.position_packet_count == 0) return "no position packets";
  if (!gps.fix || !gps.fix->valid) return "no fix";
  return fmt::format("a fix, but {:.1f} m/s: drive faster than {} m/s", gps.fix->speed_mps.value_or(0),
                     StartFixFinder::kLeastSpeed_mps);
}

}  // namespace

Expected<AnchorSettings> anchor_from_gps(LidarInput& lidar, InputKind kind, const Service& service) {
  // The only model without position packets: live, waiting for them would have no end.
  const bool never = lidar.model == LidarModel::hdl64e_s2 || lidar.model == LidarModel::hdl64e_s3;
  if (kind == InputKind::live && never) {
    return fail(std::string("[anchor] is missing, and an HDL-64E sends no positions: ") + kRemedy);
  }
  SensorClock clock;
  StartFixFinder finder;
  std::span<const RawPacket> batch;
  for (;;) {
    const ReadResult result = lidar.source->read(batch, kTurn);
    for (const RawPositionPacket& packet : lidar.source->positions()) {
      const NmeaFix* const news = clock.add(packet);
      const auto fix = news != nullptr ? finder.add(*news) : std::nullopt;
      if (fix) return settings_from(*fix);
    }
    if (result == ReadResult::failed) return fail(std::string(lidar.source->error()));
    if (result == ReadResult::end) {
      return fail("[anchor] is missing, and the sensor's GPS tells " + waiting_text(clock.report()) + ": " + kRemedy);
    }
    if (kind == InputKind::recorded) continue;
    Service::starting("waiting for the GPS at the LiDAR: " + waiting_text(clock.report()));
    if (const auto signal = service.wait_for_signal(std::chrono::milliseconds{0});
        signal == SIGINT || signal == SIGTERM) {
      return fail("asked to stop while waiting for a GPS fix; there is no map");
    }
  }
}

}  // namespace roadvec
