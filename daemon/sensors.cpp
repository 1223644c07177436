#include "daemon/sensors.h"

#include <arpa/inet.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <system_error>

#include "core/base/angle.h"
#include "drivers/can/can_log_reader.h"
#include "drivers/can/socketcan_reader.h"
#include "drivers/imu/log_reader.h"
#include "drivers/imu/serial_reader.h"
#include "drivers/velodyne/pcap_reader.h"
#include "drivers/velodyne/udp_receiver.h"

namespace roadvec {
namespace {

// Without a car on the bus only the IMU turns the filter; the wheelbase then never counts, but it must not divide by
// zero.
constexpr VehicleGeometry kNoVehicle{.wheelbase_m = 1, .track_m = 1, .steering_ratio = 1};

Expected<std::optional<std::uint32_t>> address_of(const std::string& text) {
  if (text.empty()) return std::optional<std::uint32_t>{};
  in_addr address{};
  if (::inet_pton(AF_INET, text.c_str(), &address) != 1) {
    return fail("lidar.source_address '" + text + "' is not an IPv4 address such as 192.168.1.201");
  }
  return std::optional<std::uint32_t>{ntohl(address.s_addr)};
}

PacketClockOptions clock_options(const LidarSettings& settings) {
  PacketTimeBase base = PacketTimeBase::arrival;
  if (settings.clock == LidarClock::device) base = PacketTimeBase::device;
  if (settings.clock == LidarClock::device_utc) base = PacketTimeBase::device_utc;
  return {.base = base,
          .stamp = settings.stamp == LidarStamp::first_firing ? PacketStampMeaning::first_firing
                                                              : PacketStampMeaning::last_firing};
}

Expected<std::unique_ptr<PacketSource>> open_packets(const LidarSettings& settings, InputKind kind,
                                                     LidarCounters& counters) {
  const auto address = address_of(settings.source_address);
  if (!address) return tl::unexpected(address.error());
  if (kind == InputKind::recorded) {
    auto reader = PcapReader::open(settings.pcap, {.port = settings.port, .source_ipv4 = *address}, counters);
    if (!reader) return tl::unexpected(reader.error());
    return std::unique_ptr<PacketSource>(std::move(*reader));
  }
  auto receiver = UdpReceiver::open(
      {.port = settings.port, .source_ipv4 = *address, .receive_buffer_bytes = settings.receive_buffer_bytes},
      counters);
  if (!receiver) return tl::unexpected(receiver.error());
  return std::unique_ptr<PacketSource>(std::move(*receiver));
}

SignalExpression expression_of(const SignalSettings& settings) {
  SignalExpression expression;
  expression.sum = settings.sum;
  expression.sign = settings.sign;
  expression.scale = settings.scale;
  expression.unit = settings.unit;
  expression.valid = settings.valid;
  if (settings.valid_raw) expression.valid_raw = static_cast<std::uint64_t>(*settings.valid_raw);
  if (settings.invalid_raw) expression.invalid_raw = static_cast<std::uint64_t>(*settings.invalid_raw);
  return expression;
}

Expected<std::unique_ptr<CanReader>> open_can(const VehicleSettings& settings, InputKind kind,
                                              std::span<const CanId> ids) {
  if (kind == InputKind::recorded || settings.can.find('/') != std::string::npos) {
    if (std::error_code ignored; kind == InputKind::recorded && std::filesystem::is_fifo(settings.can, ignored))
      return fail("vehicle.can: " + settings.can + " is a FIFO, which has no end; a drive needs a file");
    auto reader = CanLogReader::open(settings.can, "", std::llround(settings.can_log_offset_s * 1e9));
    if (!reader) return tl::unexpected(reader.error());
    return std::unique_ptr<CanReader>(std::move(*reader));
  }
  auto reader = SocketCanReader::open(settings.can, ids);
  if (!reader) return tl::unexpected(reader.error());
  return std::unique_ptr<CanReader>(std::move(*reader));
}

/// The first lines that could not be read, and how many there are.
void warn_of(const DbcFile& dbc) {
  constexpr std::size_t kShown = 5;
  const std::size_t count = dbc.diagnostics.size();
  for (std::size_t i = 0; i < std::min(count, kShown); ++i) spdlog::warn("{}", dbc.diagnostics[i].text);
  if (count > 0) spdlog::warn("{}: {} lines are not as a DBC file has them; the rest of it is used", dbc.name, count);
}

Expected<std::unique_ptr<CanInput>> open_can_input(const VehicleSettings& settings, InputKind kind) {
  const auto dbc = load_dbc(settings.dbc.string());
  if (!dbc) return tl::unexpected(dbc.error());
  warn_of(*dbc);
  VehicleSignals signals;
  signals.steering = expression_of(settings.steering_signal);
  for (const SignalSettings& wheel : settings.wheel_speed_signals) signals.wheel_speeds.push_back(expression_of(wheel));
  signals.wheel_radius_m = settings.wheel_radius_m;
  for (const MessageSettings& m : settings.messages) {
    signals.messages.push_back({m.message, m.counter, m.checksum, m.kind, m.timeout_ms * 1e-3});
  }
  auto decoder = MotionDecoder::create(*dbc, signals);
  if (!decoder) return tl::unexpected(decoder.error());
  auto reader = open_can(settings, kind, decoder->ids());
  if (!reader) return tl::unexpected(reader.error());
  return std::make_unique<CanInput>(std::move(*reader), std::move(*decoder));
}

Expected<std::unique_ptr<XsensInput>> open_imu_input(const ImuSettings& settings, InputKind kind) {
  if (settings.protocol != ImuProtocol::xsens) {
    return fail("imu.protocol: this version reads \"xsens\" alone; remove the [imu] table to drive on the CAN bus");
  }
  const Mounting mounting{rad_from_deg(settings.mounting.roll_deg), rad_from_deg(settings.mounting.pitch_deg),
                          rad_from_deg(settings.mounting.yaw_deg)};
  if (kind == InputKind::recorded) {
    auto reader = open_imu_recording(settings.log.string());
    if (!reader) return tl::unexpected(reader.error());
    return std::make_unique<XsensInput>(std::move(*reader), mounting);
  }
  auto reader = SerialReader::open(settings.device.string(), settings.baud);
  if (!reader) return tl::unexpected(reader.error());
  return std::make_unique<XsensInput>(std::move(*reader), mounting);
}

}  // namespace

Expected<LidarInput> open_lidar(const LidarSettings& settings, InputKind kind, LidarCounters& counters) {
  const auto model = lidar_model_from(settings.model);
  if (!model) return tl::unexpected(model.error());
  auto calibration = calibration_for(*model, settings.calibration);
  if (!calibration) return tl::unexpected(calibration.error());
  auto source = open_packets(settings, kind, counters);
  if (!source) return tl::unexpected(source.error());
  const Correction correction = settings.correction == LidarCorrection::manual ? Correction::manual : Correction::ros;
  SweepDecoderOptions options{.decode = {.correction = correction}, .clock = clock_options(settings), .assemble = {}};
  if (settings.turn != LidarTurn::model) options.decode.maybe_follow_turn = settings.turn == LidarTurn::follow;
  return LidarInput{*model, std::move(*calibration), options, std::move(*source)};
}

Expected<std::vector<std::unique_ptr<MotionInput>>> open_vehicle(const Settings& settings, InputKind kind) {
  std::vector<std::unique_ptr<MotionInput>> inputs;
  if (settings.vehicle) {
    auto can = open_can_input(*settings.vehicle, kind);
    if (!can) return tl::unexpected(can.error());
    inputs.push_back(std::move(*can));
  }
  if (settings.imu) {
    auto imu = open_imu_input(*settings.imu, kind);
    if (!imu) return tl::unexpected(imu.error());
    inputs.push_back(std::move(*imu));
  }
  return inputs;
}

FrontEndSetup front_end_setup(const Settings& settings, LidarModel model) {
  FrontEndSetup setup{.vehicle = kNoVehicle, .lidar = {}, .max_returns_per_sweep = max_returns_per_sweep(model)};
  if (settings.vehicle) {
    setup.vehicle = {settings.vehicle->wheelbase_m, settings.vehicle->track_m, settings.vehicle->steering_ratio};
  }
  const LidarSettings& lidar = settings.lidar;
  setup.lidar = mounting_from({lidar.x_m, lidar.y_m, lidar.z_m}, rad_from_deg(lidar.mounting.roll_deg),
                              rad_from_deg(lidar.mounting.pitch_deg), rad_from_deg(lidar.mounting.yaw_deg));
  return setup;
}

}  // namespace roadvec
