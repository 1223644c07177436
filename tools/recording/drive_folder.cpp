#include "tools/recording/drive_folder.h"

#include <system_error>

namespace roadvec {
namespace {

namespace fs = std::filesystem;

/// As part of a TOML text in quotes.
std::string harmless(std::string text) {
  for (char& c : text) c = c < ' ' || c == '"' || c == '\\' || c == 0x7F ? '_' : c;
  return text;
}

std::string angles(const MountingDegrees& mounting) {
  return print("roll_deg = %.4f\npitch_deg = %.4f\nyaw_deg = %.4f\n", mounting.roll_deg, mounting.pitch_deg,
               mounting.yaw_deg);
}

}  // namespace

std::string drive_toml(const DriveDescription& drive) {
  std::string text = print("source = \"%s\"\n\n[lidar]\nmodel = \"%s\"\n", harmless(drive.source).c_str(),
                           harmless(drive.lidar_model).c_str());
  if (drive.has_calibration) text += "calibration = \"db.xml\"\n";
  text += print("pcap = \"lidar.pcap\"\nx_m = %.4f\ny_m = %.4f\nz_m = %.4f\n", drive.lidar_x_m, drive.lidar_y_m,
                drive.lidar_z_m);
  text += angles(drive.lidar);
  text += print("\n[vehicle]\nwheelbase_m = %.4f\ntrack_m = %.4f\nsteering_ratio = %.4f\n", drive.wheelbase_m,
                drive.track_m, drive.steering_ratio);
  text +=
      "can = \"can.log\"\ndbc = \"vehicle.dbc\"\nsteering_signal = \"SteeringSensor.SteeringWheelAngle\"\n"
      "wheel_speed_signals = [\"WheelSpeeds.WheelSpeedFL\", \"WheelSpeeds.WheelSpeedFR\", "
      "\"WheelSpeeds.WheelSpeedRL\", \"WheelSpeeds.WheelSpeedRR\"]\n"
      "\n[imu]\nprotocol = \"xsens\"\nlog = \"imu.log\"\n";
  text += angles(drive.imu);
  return text + print("\n[anchor]\nlatitude_deg = %.9f\nlongitude_deg = %.9f\nheight_m = %.3f\nyaw_deg = %.6f\n",
                      drive.anchor.latitude_deg, drive.anchor.longitude_deg, drive.anchor.height_m,
                      drive.anchor.yaw_deg);
}

Expected<void> make_drive_folder(const fs::path& out) {
  std::error_code code;
  if (fs::exists(out, code) && !(fs::is_directory(out, code) && fs::is_empty(out, code))) {
    return fail(out.string() + " is there already and not an empty folder; name another one or remove it");
  }
  if (!code) fs::create_directories(out / "truth", code);
  if (code) return fail("cannot make the folder " + out.string() + ": " + code.message());
  return {};
}

}  // namespace roadvec
