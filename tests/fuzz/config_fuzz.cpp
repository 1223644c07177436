#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "daemon/config/config_text.h"
#include "daemon/config/load.h"

/// Any text is either refused with a reason, or becomes settings that survive being printed and read again.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace roadvec;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto context = static_cast<ConfigContext>(size % 3);
  const auto settings = parse_settings(text, "fuzz.toml", "/dev", context);
  if (!settings) {
    if (settings.error().message.empty()) std::abort();
  } else if (context != ConfigContext::overrides) {
    const std::string printed = config_text(*settings, context);
    const auto again = parse_settings(printed, "printed.toml", "/", context);
    if (!again || config_text(*again, context) != printed) std::abort();
  }
  return 0;
}
