#include <cmath>
#include <cstddef>
#include <cstdint>

#include "core/base/ensure.h"
#include "drivers/velodyne/calibration.h"
#include "drivers/velodyne/decode.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace roadvec;
  const auto calibration = parse_db_xml({reinterpret_cast<const char*>(data), size}, "db.xml");
  if (!calibration) {
    ENSURE(calibration.error().message.starts_with("db.xml: "));
    return 0;
  }
  LidarCounters counters;
  for (const LidarModel model : {LidarModel::hdl64e_s2, LidarModel::hdl32e, LidarModel::vlp16}) {
    if (const auto fitted = fit_to_model(*calibration, model, "db.xml"))
      const PacketDecoder decoder(model, *fitted, {}, counters);
  }
  return 0;
}
