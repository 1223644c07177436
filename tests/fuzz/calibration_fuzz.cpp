#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/base/ensure.h"
#include "drivers/velodyne/calibration.h"
#include "drivers/velodyne/decode.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace roadvec;
  // XML or the YAML of ROS, by the first byte as load_calibration() has it.
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto calibration =
      text.starts_with('<') ? parse_db_xml(text, "db.xml") : parse_calibration_yaml(text, "db.xml");
  if (!calibration) {
    ENSURE(calibration.error().message.starts_with("db.xml: "));
    return 0;
  }
  LidarCounters counters;
  for (const LidarModel model : {LidarModel::hdl64e_s2, LidarModel::hdl32e, LidarModel::vlp16, LidarModel::vls128}) {
    if (const auto fitted = fit_to_model(*calibration, model, "db.xml"))
      const PacketDecoder decoder(model, *fitted, {}, counters);
  }
  return 0;
}
