#include "daemon/reload.h"

#include <spdlog/spdlog.h>

#include <sstream>

#include "daemon/config/config_text.h"
#include "daemon/config/load.h"
#include "daemon/log.h"

namespace roadvec {
namespace {

std::string or_absent(const std::string& value) { return value.empty() ? "not there" : value; }

}  // namespace

std::string Reload::run() {
  const Expected<Settings> read = load_settings(file_);
  if (!read) {
    std::istringstream lines(read.error().message);
    std::string first;
    for (std::string line; std::getline(lines, line);) {
      spdlog::error("{}", line);
      if (first.empty()) first = line;
    }
    spdlog::error("{} is wrong: everything goes on as configured before", file_.native());
    return first;
  }
  const std::vector<KeyChange> changes = changed_keys(running_, *read);
  if (changes.empty()) spdlog::info("{} read again: it says what we run with", file_.native());
  for (const KeyChange& change : changes) {
    const bool applied = change.key == "log.level";
    if (applied) set_log_level(running_.log.level = read->log.level);
    // Said at a level that every setting of log.level but "error" lets through.
    spdlog::warn("{} read again: {}: {} -> {}: {}", file_.native(), change.key, or_absent(change.before),
                 or_absent(change.after), applied ? "applied" : "needs a restart");
  }
  return {};
}

}  // namespace roadvec
