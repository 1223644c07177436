#pragma once

#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace roadvec {

/// A file with the given bytes that goes with the object.
class TempFile {
 public:
  explicit TempFile(const std::vector<std::uint8_t>& bytes)
      : path_(std::filesystem::temp_directory_path() / unique_name()) {
    std::ofstream(path_, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  explicit TempFile(const std::string& text) : TempFile(std::vector<std::uint8_t>(text.begin(), text.end())) {}
  ~TempFile() { std::filesystem::remove(path_); }
  TempFile(const TempFile&) = delete;
  TempFile& operator=(const TempFile&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  static std::string unique_name() {
    static int count = 0;
    return "roadvec_test_" + std::to_string(::getpid()) + "_" + std::to_string(++count);
  }
  std::filesystem::path path_;
};

}  // namespace roadvec
