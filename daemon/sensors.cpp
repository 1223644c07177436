#include "daemon/sensors.h"

#include <arpa/inet.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <system_error>

#include "core/base/angle.h"
#include "drivers/can/can_capture_reader.h"
#include "drivers/can/socketcan_reader.h"
#include "drivers/imu/log_reader.h"
#include "drivers/imu/serial_reader.h"
#include "drivers/imu/udp_reader.h"
#include "drivers/imu/xsens_setup.h"
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
                                                     LidarCounters& counters, const PassedSockets& sockets) {
  const auto address = address_of(settings.source_address);
  if (!address) return tl::unexpected(address.error());
  if (kind == InputKind::recorded) {
    auto reader = PcapReader::open(
        settings.pcap, {.port = settings.port, .position_port = settings.position_port, .source_ipv4 = *address},
        counters);
    if (!reader) return tl::unexpected(reader.error());
    return std::unique_ptr<PacketSource>(std::move(*reader));
  }
  auto receiver = UdpReceiver::open({.port = settings.port,
                                     .position_port = settings.position_port,
                                     .source_ipv4 = *address,
                                     .receive_buffer_bytes = settings.receive_buffer_bytes,
                                     .adopted_fd = sockets.udp_fd(settings.port),
                                     .adopted_position_fd = sockets.udp_fd(settings.position_port)},
                                    counters);
  if (!receiver) return tl::unexpected(receiver.error());
  if (const int granted = (*receiver)->receive_buffer_bytes(); granted < settings.receive_buffer_bytes) {
    spdlog::warn(
        "UDP port {}: a receive buffer of {} bytes, not {}: raise ReceiveBuffer= of roadvec-lidar.socket, or "
        "net.core.rmem_max",
        settings.port, granted, settings.receive_buffer_bytes);
  }
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

/// `key`: who names the source.
Expected<std::unique_ptr<CanReader>> open_can(const std::string& can, const std::string& key, InputKind kind,
                                              std::span<const CanId> ids, std::int64_t offset_ns) {
  if (kind == InputKind::recorded || can.find('/') != std::string::npos) {
    if (std::error_code ignored; kind == InputKind::recorded && std::filesystem::is_fifo(can, ignored))
      return fail(key + ": " + can + " is a FIFO, which has no end; a drive needs a file");
    return open_can_log(can, offset_ns);
  }
  auto reader = SocketCanReader::open(can, ids);
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

Expected<std::unique_ptr<MotionInput>> open_can_input(const VehicleSettings& settings, InputKind kind) {
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
  auto reader =
      open_can(settings.can, "vehicle.can", kind, decoder->ids(), std::llround(settings.can_log_offset_s * 1e9));
  if (!reader) return tl::unexpected(reader.error());
  return std::unique_ptr<MotionInput>(
      std::make_unique<CanInput<MotionDecoder>>(std::move(*reader), std::move(*decoder)));
}

Mounting mounting_of(const ImuSettings& settings) {
  return {rad_from_deg(settings.mounting.roll_deg), rad_from_deg(settings.mounting.pitch_deg),
          rad_from_deg(settings.mounting.yaw_deg)};
}

/// An IMU on a bus; where [imu] names none, on the vehicle's, with its DBC file.
Expected<std::unique_ptr<MotionInput>> open_imu_on_can(const Settings& settings, InputKind kind) {
  const ImuSettings& imu = *settings.imu;
  const std::string can = imu.can.empty() ? settings.vehicle->can : imu.can;
  const auto dbc = load_dbc((imu.dbc.empty() ? settings.vehicle->dbc : imu.dbc).string());
  if (!dbc) return tl::unexpected(dbc.error());
  std::error_code ignored;
  if (settings.vehicle && can == settings.vehicle->can && std::filesystem::is_fifo(can, ignored)) {
    return fail("imu.can: " + can + " is the vehicle's FIFO, and of two readers each gets a part; give each its own");
  }
  // The vehicle's own log is put on the LiDAR's clock by the vehicle's offset.
  const bool same_log = settings.vehicle && can == settings.vehicle->can;
  const std::int64_t offset_ns = same_log ? std::llround(settings.vehicle->can_log_offset_s * 1e9) : 0;
  ImuSignals signals;
  signals.rate = {expression_of(imu.rate_x_signal), expression_of(imu.rate_y_signal), expression_of(imu.rate_z_signal)};
  signals.acceleration = {expression_of(imu.acceleration_x_signal), expression_of(imu.acceleration_y_signal),
                          expression_of(imu.acceleration_z_signal)};
  signals.roll = expression_of(imu.roll_signal);
  signals.pitch = expression_of(imu.pitch_signal);
  signals.heading = expression_of(imu.heading_signal);
  auto decoder = ImuCanDecoder::create(*dbc, signals, mounting_of(imu));
  if (!decoder) return tl::unexpected(decoder.error());
  auto reader = open_can(can, "imu.can", kind, decoder->ids(), offset_ns);
  if (!reader) return tl::unexpected(reader.error());
  return std::unique_ptr<MotionInput>(
      std::make_unique<CanInput<ImuCanDecoder>>(std::move(*reader), std::move(*decoder)));
}

Expected<std::unique_ptr<ImuReader>> open_imu_reader(const ImuSettings& settings, InputKind kind,
                                                     const PassedSockets& sockets, std::string& device_text) {
  if (kind == InputKind::recorded) return open_imu_recording(settings.log.string());
  if (settings.protocol == ImuProtocol::ncom) {
    auto reader = ImuUdpReader::open(settings.port, sockets.udp_fd(settings.port));
    if (!reader) return tl::unexpected(reader.error());
    return std::unique_ptr<ImuReader>(std::move(*reader));
  }
  const auto baud = static_cast<unsigned>(settings.baud);
  if (settings.configure) {
    const auto device = set_up_xsens(settings.device.string(), baud, default_xsens_outputs());
    if (!device) return tl::unexpected(device.error());
    spdlog::info("IMU set up: {}", device->text());
    device_text = device->text();
  }
  auto reader = SerialReader::open(settings.device.string(), baud);
  if (!reader) return tl::unexpected(reader.error());
  return std::unique_ptr<ImuReader>(std::move(*reader));
}

Expected<std::unique_ptr<MotionInput>> open_imu_input(const ImuSettings& settings, InputKind kind,
                                                      const PassedSockets& sockets, std::string& device_text) {
  const Mounting mounting = mounting_of(settings);
  auto reader = open_imu_reader(settings, kind, sockets, device_text);
  if (!reader) return tl::unexpected(reader.error());
  if (settings.protocol == ImuProtocol::ncom) {
    return std::unique_ptr<MotionInput>(std::make_unique<ImuInput<NcomDecoder>>(std::move(*reader), mounting));
  }
  return std::unique_ptr<MotionInput>(std::make_unique<ImuInput<XsensDecoder>>(std::move(*reader), mounting));
}

}  // namespace

Expected<LidarInput> open_lidar(const LidarSettings& settings, InputKind kind, LidarCounters& counters,
                                const PassedSockets& sockets) {
  const auto model = lidar_model_from(settings.model);
  if (!model) return tl::unexpected(model.error());
  auto calibration = calibration_for(*model, settings.calibration);
  if (!calibration) return tl::unexpected(calibration.error());
  auto source = open_packets(settings, kind, counters, sockets);
  if (!source) return tl::unexpected(source.error());
  const Correction correction = settings.correction == LidarCorrection::manual ? Correction::manual : Correction::ros;
  SweepDecoderOptions options{.decode = {.correction = correction}, .clock = clock_options(settings), .assemble = {}};
  if (settings.turn != LidarTurn::model) options.decode.maybe_follow_turn = settings.turn == LidarTurn::follow;
  return LidarInput{*model, std::move(*calibration), options, std::move(*source)};
}

Expected<VehicleInput> open_vehicle(const Settings& settings, InputKind kind, const PassedSockets& sockets) {
  VehicleInput vehicle;
  if (settings.vehicle) {
    auto can = open_can_input(*settings.vehicle, kind);
    if (!can) return tl::unexpected(can.error());
    vehicle.inputs.push_back(std::move(*can));
  }
  if (settings.imu) {
    auto imu = settings.imu->protocol == ImuProtocol::can
                   ? open_imu_on_can(settings, kind)
                   : open_imu_input(*settings.imu, kind, sockets, vehicle.imu_device);
    if (!imu) return tl::unexpected(imu.error());
    vehicle.inputs.push_back(std::move(*imu));
  }
  return vehicle;
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
