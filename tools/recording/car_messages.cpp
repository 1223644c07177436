#include "tools/recording/car_messages.h"

#include <algorithm>
#include <cmath>

#include "tools/recording/output_file.h"

namespace roadvec {

std::string vehicle_dbc(const CarMessageSteps& steps) {
  std::string text = print(
      "VERSION \"1\"\n\nNS_ :\n\nBS_:\n\nBU_: EPS ABS\n\n"
      "BO_ 194 SteeringSensor: 4 EPS\n"
      " SG_ SteeringWheelAngle : 7|16@0- (%g,0) [-800|800] \"deg\" ABS\n"
      " SG_ SteeringCounter : 24|4@1+ (1,0) [0|15] \"\" ABS\n\n"
      "BO_ 416 WheelSpeeds: 8 ABS\n",
      steps.steering_deg);
  int bit = 0;
  for (const char* wheel : {"FL", "FR", "RL", "RR"}) {
    text += print(" SG_ WheelSpeed%s : %d|16@1+ (%g,0) [0|%g] \"km/h\" EPS\n", wheel, bit, steps.wheel_speed_kmph,
                  65535 * steps.wheel_speed_kmph);
    bit += 16;
  }
  return text +
         "\nCM_ SG_ 194 SteeringWheelAngle \"Left positive.\";\n"
         "BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 10000;\n"
         "BA_DEF_DEF_ \"GenMsgCycleTime\" 0;\n"
         "BA_ \"GenMsgCycleTime\" BO_ 194 10;\n"
         "BA_ \"GenMsgCycleTime\" BO_ 416 20;\n";
}

std::string steering_frame(const CarMessageSteps& steps, double wheel_deg, unsigned counter) {
  const long raw = std::clamp(std::lround(wheel_deg / steps.steering_deg), -32768L, 32767L);
  return print("0C2#%04X00%02X", static_cast<unsigned>(raw) & 0xFFFF, counter & 0xF);
}

std::string wheel_frame(const CarMessageSteps& steps, const std::array<double, 4>& speeds_mps) {
  std::string frame = "1A0#";
  for (const double speed_mps : speeds_mps) {
    const auto raw =
        static_cast<unsigned>(std::clamp(std::lround(3.6 * speed_mps / steps.wheel_speed_kmph), 0L, 65535L));
    frame += print("%02X%02X", raw & 0xFF, raw >> 8);
  }
  return frame;
}

std::array<double, 4> wheel_speeds_mps(double wheelbase_m, double track_m, double speed_mps, double yaw_rate_radps) {
  const double w = yaw_rate_radps, left_mps = speed_mps - w * track_m / 2, right_mps = speed_mps + w * track_m / 2;
  const double side_mps = w * wheelbase_m;
  return {std::hypot(left_mps, side_mps), std::hypot(right_mps, side_mps), std::abs(left_mps), std::abs(right_mps)};
}

std::string stamp(SensorTime time) {
  return print("%lld.%06lld", static_cast<long long>(time.ns / 1'000'000'000),
               static_cast<long long>(time.ns % 1'000'000'000 / 1000));
}

}  // namespace roadvec
