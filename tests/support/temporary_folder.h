#pragma once

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "tools/recording/temporary_folder.h"

namespace roadvec {

[[nodiscard]] inline std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

}  // namespace roadvec
