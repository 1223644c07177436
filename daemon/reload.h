#pragma once

#include <filesystem>
#include <string>

#include "daemon/config/settings.h"

namespace roadvec {

/// What SIGHUP asks for: the configuration file is read again. log.level changes at once; of every other key that
/// differs from what runs the log says that it waits for a restart, since sensors, threads and steps are set up once. A
/// file that is wrong changes nothing, and the log says what is wrong with it, line by line.
class Reload {
 public:
  /// `running` as it was read from `file` at the start.
  Reload(std::filesystem::path file, const Settings& running) : file_(std::move(file)), running_(running) {}
  /// What is wrong with the file, in one line; empty: nothing.
  std::string run();

 private:
  std::filesystem::path file_;
  Settings running_;
};

}  // namespace roadvec
