#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/pipeline/config.h"
#include "drivers/can/checksum.h"

namespace roadvec {

// Plain values as a person wrote them: degrees stay degrees, names stay names. The stages turn them into driver and
// pipeline types. Every field's key, range, default and meaning: fields.cpp. Paths are resolved against the file that
// names them.

/// A sensor's axes in the vehicle frame, R = Rz Ry Rx.
struct MountingAngles {
  double roll_deg = 0, pitch_deg = 0, yaw_deg = 0;
};

enum class LidarClock : std::uint8_t { arrival, device, device_utc };
enum class LidarStamp : std::uint8_t { first_firing, last_firing };
enum class LidarTurn : std::uint8_t { model, follow, as_read };
enum class LidarCorrection : std::uint8_t { manual, ros };
struct LidarSettings {
  std::string model;
  std::filesystem::path calibration;  ///< empty: built-in angles; kStreamedCalibration: as the sensor sends it
  std::filesystem::path pcap;         ///< drives only
  int port = 2368, position_port = 8308;
  std::string source_address;  ///< empty: the first sender
  int receive_buffer_bytes = 8 << 20;
  LidarClock clock = LidarClock::arrival;
  LidarStamp stamp = LidarStamp::first_firing;
  LidarTurn turn = LidarTurn::model;
  LidarCorrection correction = LidarCorrection::manual;
  double x_m = 0, y_m = 0, z_m = 0;
  MountingAngles mounting;
};

/// One quantity on the CAN bus: scale times the sum of the named signals, negated while `sign` is not 0, used while
/// `valid` is `valid_raw` (not told: not 0) and no signal of the sum is `invalid_raw`.
struct SignalSettings {
  std::vector<std::string> sum;  ///< "Message.Signal", names of the DBC; empty: the car does not send this quantity
  std::string sign;              ///< may be empty
  std::string valid;             ///< may be empty
  std::string unit;              ///< empty: the one the DBC tells
  double scale = 1.0;
  std::optional<std::int64_t> valid_raw, invalid_raw;  ///< bits as they are on the bus

  friend bool operator==(const SignalSettings&, const SignalSettings&) = default;
};

/// How the frames of one message are checked; names of its own signals, empty: not at all.
struct MessageSettings {
  std::string message, counter, checksum;
  ChecksumKind kind = ChecksumKind::none;
  double timeout_ms = 0;  ///< 0: five of the cycle times that the DBC tells

  friend bool operator==(const MessageSettings&, const MessageSettings&) = default;
};

struct VehicleSettings {
  double wheelbase_m = 0, track_m = 0, steering_ratio = 0;
  std::string can;  ///< interface, or the path of a log or FIFO (then it contains a '/')
  double can_log_offset_s = 0;
  std::filesystem::path dbc;
  SignalSettings steering_signal;
  std::vector<SignalSettings>
      wheel_speed_signals;    ///< 1: the vehicle; 2: rear left, right; 4: front left, right, rear left, right
  double wheel_radius_m = 0;  ///< 0: unknown; needed for signals in rpm or rad/s
  std::vector<MessageSettings> messages;
};

enum class ImuProtocol : std::uint8_t { xsens, ncom, can };
struct ImuSettings {
  ImuProtocol protocol = ImuProtocol::xsens;
  std::filesystem::path log;     ///< drives only
  std::filesystem::path device;  ///< xsens in the car: serial line
  int baud = 115200;
  bool configure = false;  ///< xsens in the car: set the device's outputs before reading
  int port = 3000;         ///< ncom in the car: UDP
  MountingAngles mounting;
  std::string can;            ///< protocol can; empty: the vehicle's
  std::filesystem::path dbc;  ///< protocol can; empty: the vehicle's
  SignalSettings rate_x_signal, rate_y_signal, rate_z_signal;
  SignalSettings acceleration_x_signal, acceleration_y_signal, acceleration_z_signal;
  SignalSettings roll_signal, pitch_signal, heading_signal;
};

/// The start fix: where the map frame lies on the earth and how the vehicle stands in it.
struct AnchorSettings {
  double latitude_deg = 0, longitude_deg = 0, height_m = 0;
  double yaw_deg = 0;  ///< East-North-Up: 0 = east, counter-clockwise
};

struct ServerSettings {
  std::filesystem::path socket = "/run/roadvec/map.sock";
  std::filesystem::path control_socket = "/run/roadvec/control.sock";
  std::string group;
  int most_clients = 64, most_clients_per_user = 16;  ///< choice: no user can keep the others out
};

struct StorageSettings {
  std::filesystem::path directory = "/var/lib/roadvec";
  double batch_s = 2;  ///< choice: what a crash may cost, against wear of the disk
  bool resume = true;
};

enum class LogLevel : std::uint8_t { trace, debug, info, warning, error };
enum class LogTarget : std::uint8_t { automatic, terminal, journal };
struct LogSettings {
  LogLevel level = LogLevel::info;
  LogTarget target = LogTarget::automatic;
};

/// SCHED_FIFO priorities (0: ordinary thread) and processors (-1: any).
struct RealTimeSettings {
  int lidar_priority = 40, vehicle_priority = 40, mapping_priority = 30;
  int lidar_cpu = -1, vehicle_cpu = -1, mapping_cpu = -1, background_cpu = -1;
  bool lock_memory = true;
};

/// Reference of a drive; empty where the drive has none.
struct TruthSettings {
  std::filesystem::path poses, boundaries;
};

/// Everything roadvecd is told, in the car or for a drive. vehicle or imu may be missing, never both.
struct Settings {
  std::string source;  ///< drives only: where the recording comes from, and its licence
  TruthSettings truth;
  LidarSettings lidar;
  std::optional<VehicleSettings> vehicle;
  std::optional<ImuSettings> imu;
  std::optional<AnchorSettings> anchor;  ///< missing: taken from the sensor's own GPS messages
  ServerSettings server;
  StorageSettings storage;
  LogSettings log;
  RealTimeSettings real_time;
  PipelineConfig pipeline;
};

}  // namespace roadvec
