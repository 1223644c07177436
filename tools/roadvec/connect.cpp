#include <cmath>
#include <cstdio>
#include <sstream>

#include "tools/roadvec/commands.h"

namespace roadvec {

Expected<MapClient> connect(const Connection& connection) {
  return MapClient::connect(connection.socket_path, "roadvec " ROADVEC_VERSION,
                            MapClient::Seconds(connection.timeout_s));
}

int complain(const Error& error, int exit_code) {
  std::fprintf(stderr, "roadvec: %s\n", error.message.c_str());
  return exit_code;
}

Expected<wire::Area> parse_area(const std::string& text) {
  std::istringstream in(text);
  in.imbue(std::locale::classic());
  double x_min_m = 0, y_min_m = 0, x_max_m = 0, y_max_m = 0;
  char comma1 = 0, comma2 = 0, comma3 = 0;
  in >> x_min_m >> comma1 >> y_min_m >> comma2 >> x_max_m >> comma3 >> y_max_m;
  const bool commas = comma1 == ',' && comma2 == ',' && comma3 == ',';
  const bool finite =
      std::isfinite(x_min_m) && std::isfinite(y_min_m) && std::isfinite(x_max_m) && std::isfinite(y_max_m);
  if (!in || !commas || !(in >> std::ws).eof() || !finite)
    return fail("area '" + text + "' is not x_min,y_min,x_max,y_max in metres");
  if (x_min_m > x_max_m || y_min_m > y_max_m) return fail("area '" + text + "': the smaller corner comes first");
  return wire::Area{mm_from_m(x_min_m), mm_from_m(y_min_m), mm_from_m(x_max_m), mm_from_m(y_max_m)};
}

}  // namespace roadvec
