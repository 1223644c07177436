#include "daemon/config/fields.h"

#include <iterator>
#include <utility>

namespace roadvec {
namespace {

constexpr const char* kLidarModels[] = {"HDL-64E S2",  "HDL-64E S3", "HDL-32E", "VLP-16",
                                        "Puck Hi-Res", "VLP-32C",    "VLS-128"};
constexpr const char* kLidarClocks[] = {"arrival", "device", "device_utc"};
constexpr const char* kLidarStamps[] = {"first_firing", "last_firing"};
constexpr const char* kLidarTurns[] = {"model", "follow", "as_read"};
constexpr const char* kLidarCorrections[] = {"manual", "ros"};
constexpr const char* kImuProtocols[] = {"xsens", "ncom", "can"};
constexpr const char* kLogLevels[] = {"trace", "debug", "info", "warning", "error"};
constexpr const char* kLogTargets[] = {"auto", "terminal", "journal"};

void visit_fields(MountingAngles& s, const std::string& table, const std::string& example, FieldList& field) {
  field(table + ".roll_deg", s.roll_deg, -180, 180, "rotation about x of the sensor in the vehicle frame, R = Rz Ry Rx")
      .is_required(example);
  field(table + ".pitch_deg", s.pitch_deg, -180, 180, "rotation about y; positive looks down").is_required(example);
  field(table + ".yaw_deg", s.yaw_deg, -360, 360, "rotation about z; positive looks left").is_required(example);
}

void visit_fields(LidarSettings& s, FieldList& field) {
  field("lidar.model", s.model, "Velodyne model; rules over what the packets say")
      .one_of(kLidarModels)
      .is_required("\"HDL-32E\"");
  field("lidar.calibration", s.calibration,
        "the sensor's db.xml or the YAML of velodyne_pointcloud; \"streamed\": the table that an HDL-64E sends itself, "
        "mapping begins when it is complete (1 to 3 s); empty: the built-in angles of models that are all alike")
      .naming(Names::calibration);
  field("lidar.pcap", s.pcap, "the recorded packets")
      .naming(Names::input_file)
      .only_in_drive()
      .is_required("\"lidar.pcap\"");
  field("lidar.port", s.port, 1, 65535, "UDP port of the data packets");
  field("lidar.position_port", s.position_port, 0, 65535,
        "UDP port of the position packets, which tell the state of GPS and clock; 0: not listened to");
  field("lidar.source_address", s.source_address,
        "IPv4 address of the sensor; empty: the first that sends. With more than one on the port, it must be given");
  field("lidar.receive_buffer_bytes", s.receive_buffer_bytes, 65536, 268435456,
        "socket receive buffer, forced and verified; 8 MiB hold about one second of an HDL-64E")
      .only_in_car();
  field("lidar.clock", s.clock, kLidarClocks,
        "what stamps the packets: their arrival at the kernel, the device's intervals, or a device set to UTC by GPS "
        "(`roadvec status` tells whether it is)");
  field("lidar.stamp", s.stamp, kLidarStamps,
        "clock device_utc: which firing of a packet the device's stamp belongs to");
  field("lidar.turn", s.turn, kLidarTurns,
        "each laser's azimuth follows the turning head, or is taken as read and the calibration holds the turn");
  field("lidar.correction", s.correction, kLidarCorrections,
        "how an HDL-64E's distances are corrected: as in its manual, or as ROS' velodyne_pointcloud does (points up to "
        "9 cm apart)");
  field("lidar.x_m", s.x_m, -20, 20, "position of the sensor ahead of the rear axle").is_required("0.76");
  field("lidar.y_m", s.y_m, -10, 10, "position left of the centre line").is_required("0.0");
  field("lidar.z_m", s.z_m, 0, 10, "height above the road").is_required("1.73");
  visit_fields(s.mounting, "lidar", "0.0", field);
}

void visit_fields(VehicleSettings& s, FieldList& field) {
  field("vehicle.wheelbase_m", s.wheelbase_m, 0.5, 20, "distance of the axles").is_required("2.71");
  field("vehicle.track_m", s.track_m, 0.5, 5, "distance of the rear wheels").is_required("1.55");
  field("vehicle.steering_ratio", s.steering_ratio, 1, 40, "angle of the steering wheel by that of the road wheels")
      .is_required("15.0");
  field("vehicle.can", s.can,
        "CAN interface; or, with a '/', the path of a log (candump, Vector ASC, pcap) or of a FIFO that carries "
        "candump's "
        "lines")
      .naming(Names::can_source)
      .is_required("\"can0\"");
  field("vehicle.can_log_offset_s", s.can_log_offset_s, -2e9, 2e9,
        "added to the times of a log: those of Vector ASC are local time, those of the other sensors UTC");
  field("vehicle.dbc", s.dbc, "DBC file that describes the messages")
      .naming(Names::input_file)
      .is_required("\"vehicles/example.dbc\"");
  field("vehicle.steering_signal", s.steering_signal,
        "angle of the steering wheel, left positive: \"Message.Signal\", or { sum = [\"...\"], sign = \"...\", "
        "valid = \"...\", valid_raw = 1, invalid_raw = 65535, unit = \"deg\", scale = 1.0 }, all but the sum optional "
        "and of one message: negative while sign is not 0, used while valid is valid_raw (not told: not 0) and no "
        "signal of the sum invalid_raw; empty: not sent")
      .is_required("\"SteeringSensor.SteeringWheelAngle\"");
  field("vehicle.wheel_speed_signals", s.wheel_speed_signals,
        "4: front left, right, rear left, right; 2: the two of an axle; 1: the vehicle; each written as the "
        "steering_signal")
      .is_required(
          "[\"WheelSpeeds.FrontLeft\", \"WheelSpeeds.FrontRight\", \"WheelSpeeds.RearLeft\", "
          "\"WheelSpeeds.RearRight\"]");
  field("vehicle.wheel_radius_m", s.wheel_radius_m, 0, 2,
        "rolling radius, for signals in rpm or rad/s; 0: none needed");
  field(
      "vehicle.messages", s.messages,
      "how frames are checked: a list of { message = \"...\", counter = \"...\", checksum = \"...\", kind = \"...\", "
      "timeout_ms = 100 }, signals of that message, all but its name optional; a wrong checksum drops the frame, a gap "
      "of the counter and silence are counted; kind: toyota | honda | tesla | hyundai_canfd | vw_mqb; without "
      "timeout_ms: five times the GenMsgCycleTime of the DBC");
}

void visit_fields(ImuSettings& s, FieldList& field) {
  field("imu.protocol", s.protocol, kImuProtocols,
        "what the device speaks: MTData2, OxTS NCOM, or signals on the CAN bus")
      .is_required("\"xsens\"");
  field("imu.log", s.log,
        "recorded messages, one '(seconds) hexbytes' a line (ncom: one packet of 72 bytes); a name that ends in .bin: "
        "the device's bytes as they are, with its own times; not for protocol can")
      .naming(Names::input_file)
      .only_in_drive()
      .for_example("\"imu.log\"");
  field("imu.device", s.device, "xsens: the serial line")
      .naming(Names::output_file)
      .only_in_car()
      .for_example("\"/dev/ttyUSB0\"");
  field("imu.baud", s.baud, 1200, 4000000, "xsens: speed of the serial line").only_in_car();
  field(
      "imu.configure", s.configure,
      "xsens: before reading, stop the device, set it to send what is used (counter, time, orientation, acceleration, "
      "rate of turn, 100 times a second), read that back and start it; false: nothing is ever written to it")
      .only_in_car();
  field("imu.port", s.port, 1, 65535, "ncom: UDP port").only_in_car();
  visit_fields(s.mounting, "imu", "0.0", field);
  field("imu.can", s.can, "can: where the signals come from; empty: as for the vehicle").naming(Names::can_source);
  field("imu.dbc", s.dbc, "can: DBC file; empty: the vehicle's").naming(Names::input_file);
  const std::pair<const char*, SignalSettings*> signals[] = {{"rate_x", &s.rate_x_signal},
                                                             {"rate_y", &s.rate_y_signal},
                                                             {"rate_z", &s.rate_z_signal},
                                                             {"acceleration_x", &s.acceleration_x_signal},
                                                             {"acceleration_y", &s.acceleration_y_signal},
                                                             {"acceleration_z", &s.acceleration_z_signal},
                                                             {"roll", &s.roll_signal},
                                                             {"pitch", &s.pitch_signal},
                                                             {"heading", &s.heading_signal}};
  for (const auto& [name, signal] : signals) {
    field(std::string("imu.") + name + "_signal", *signal,
          "can: written as vehicle.steering_signal; empty: not sent" +
              std::string(signal == &s.heading_signal ? "; clockwise from north" : ""));
  }
}

void visit_fields(AnchorSettings& s, FieldList& field) {
  field("anchor.latitude_deg", s.latitude_deg, -90, 90, "WGS 84").is_required("49.0");
  field("anchor.longitude_deg", s.longitude_deg, -180, 180, "WGS 84").is_required("8.4");
  field("anchor.height_m", s.height_m, -1000, 10000, "above the WGS 84 ellipsoid").is_required("112.0");
  field("anchor.yaw_deg", s.yaw_deg, -360, 360, "heading of the vehicle: 0 = east, counter-clockwise")
      .is_required("0.0");
}

void visit_fields(ServerSettings& s, StorageSettings& storage, LogSettings& log, FieldList& field) {
  field("server.socket", s.socket, "UNIX socket that serves the map").naming(Names::output_file);
  field("server.control_socket", s.control_socket,
        "UNIX socket for commands of the daemon's own user and root; empty: none")
      .naming(Names::output_file);
  field("server.group", s.group,
        "group whose members may read the map, beside the daemon's own user and root; empty: whoever the file mode of "
        "the socket lets in");
  field("server.most_clients", s.most_clients, 1, 1000, "clients at the same time");
  field("server.most_clients_per_user", s.most_clients_per_user, 1, 1000, "of them, those of one user");
  field("storage.directory", storage.directory, "folder of map.gpkg").naming(Names::output_file);
  field("storage.batch_s", storage.batch_s, 0.05, 60, "time between two writes: what a power cut may cost");
  field("storage.resume", storage.resume, "go on with the stored map that came by where the vehicle is");
  field("log.level", log.level, kLogLevels, "least important message that is written");
  field("log.target", log.target, kLogTargets, "auto: the journal when started by systemd, else the terminal");
}

void visit_fields(RealTimeSettings& s, FieldList& field) {
  field("real_time.lidar_priority", s.lidar_priority, 0, 98, "SCHED_FIFO priority of the thread; 0: ordinary");
  field("real_time.vehicle_priority", s.vehicle_priority, 0, 98, "SCHED_FIFO priority of the thread; 0: ordinary");
  field("real_time.mapping_priority", s.mapping_priority, 0, 98, "SCHED_FIFO priority of the thread; 0: ordinary");
  field("real_time.lidar_cpu", s.lidar_cpu, -1, 1023, "processor the thread is bound to; -1: any");
  field("real_time.vehicle_cpu", s.vehicle_cpu, -1, 1023, "processor the thread is bound to; -1: any");
  field("real_time.mapping_cpu", s.mapping_cpu, -1, 1023, "processor the thread is bound to; -1: any");
  field("real_time.background_cpu", s.background_cpu, -1, 1023, "processor of optimiser, server and store; -1: any");
  field("real_time.lock_memory", s.lock_memory, "keep all memory resident (mlockall)");
}

}  // namespace

Field& Field::is_required(std::string example_value) { return required = true, for_example(std::move(example_value)); }
Field& Field::for_example(std::string example_value) { return example = std::move(example_value), *this; }
Field& Field::only_in_car() { return in_drive = false, *this; }
Field& Field::only_in_drive() { return in_car = false, *this; }
Field& Field::naming(Names what) { return names = what, *this; }
Field& Field::one_of(std::span<const char* const> texts) { return choices = texts, *this; }

Field& FieldList::operator()(std::string key, double& value, double min, double max, std::string meaning) {
  return add(std::move(key), &value, min, max, std::move(meaning));
}
Field& FieldList::operator()(std::string key, int& value, double min, double max, std::string meaning) {
  return add(std::move(key), &value, min, max, std::move(meaning));
}
Field& FieldList::operator()(std::string key, bool& value, std::string meaning) {
  return add(std::move(key), &value, 0, 1, std::move(meaning));
}
Field& FieldList::operator()(std::string key, std::string& value, std::string meaning) {
  return add(std::move(key), &value, 0, 0, std::move(meaning));
}
Field& FieldList::operator()(std::string key, std::filesystem::path& value, std::string meaning) {
  return add(std::move(key), &value, 0, 0, std::move(meaning));
}
Field& FieldList::operator()(std::string key, SignalSettings& value, std::string meaning) {
  return add(std::move(key), &value, 0, 0, std::move(meaning));
}
Field& FieldList::operator()(std::string key, std::vector<SignalSettings>& value, std::string meaning) {
  return add(std::move(key), &value, 0, 0, std::move(meaning));
}
Field& FieldList::operator()(std::string key, std::vector<MessageSettings>& value, std::string meaning) {
  return add(std::move(key), &value, 0, 0, std::move(meaning));
}

Field& FieldList::add(std::string key, FieldTarget target, double min, double max, std::string meaning) {
  return fields_.emplace_back(Field{.key = std::move(key),
                                    .target = target,
                                    .min = min,
                                    .max = max,
                                    .meaning = std::move(meaning),
                                    .in_drive = sensor_table_});
}

std::vector<Field> fields_of(Settings& settings) {
  FieldList field;
  field.sensors_begin();
  field("source", settings.source, "where the recording comes from, and its licence").only_in_drive();
  field("truth.poses", settings.truth.poses, "reference trajectory, TUM format, map frame")
      .naming(Names::input_file)
      .only_in_drive();
  field("truth.boundaries", settings.truth.boundaries, "reference boundaries, GeoJSON, WGS 84")
      .naming(Names::input_file)
      .only_in_drive();
  visit_fields(settings.lidar, field);
  if (settings.vehicle) visit_fields(*settings.vehicle, field);
  if (settings.imu) visit_fields(*settings.imu, field);
  if (settings.anchor) visit_fields(*settings.anchor, field);
  field.sensors_end();
  visit_fields(settings.server, settings.storage, settings.log, field);
  visit_fields(settings.real_time, field);
  visit_fields(settings.pipeline, field);
  return field.take();
}

std::string table_meaning(std::string_view table) {
  constexpr std::pair<std::string_view, const char*> kMeanings[] = {
      {"truth", "reference to score against"},
      {"lidar", "the sensor, and its place in the vehicle frame (rear axle on the ground, x ahead, y left, z up)"},
      {"vehicle", "the car and its CAN bus; leave the table out if there is no CAN (then [imu] is needed)"},
      {"imu", "the inertial sensor; leave the table out if there is none (then [vehicle] is needed)"},
      {"anchor",
       "the start fix: where the map's origin lies and how the vehicle stands there; left out: from the GPS receiver "
       "at "
       "the LiDAR, once it has a fix and the vehicle drives faster than 2 m/s"},
      {"server", "the sockets"},
      {"storage", "where the map is kept"},
      {"log", "messages"},
      {"real_time", "threads; what the system refuses is reported, not fatal"}};
  for (const auto& [name, meaning] : kMeanings) {
    if (name == table) return meaning;
  }
  return {};
}

}  // namespace roadvec
