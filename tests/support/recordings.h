#pragma once

#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>

namespace roadvec {

/// Path of a shared recording, e.g. recording("velodyne/x.pcap"); empty (and said so) where the recordings are absent.
[[nodiscard]] inline std::optional<std::string> recording(const std::string& name) {
  const std::filesystem::path path = std::filesystem::path(ROADVEC_RECORDINGS) / name;
  if (std::filesystem::exists(path)) return path.string();
  std::printf("skipped: no recordings (%s)\n", path.c_str());
  return std::nullopt;
}

}  // namespace roadvec
