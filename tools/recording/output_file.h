#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "core/base/error.h"

namespace roadvec {

/// A file being written. Errors are kept until close(), so that writers need not look after every line.
class OutputFile {
 public:
  [[nodiscard]] static Expected<OutputFile> create(const std::filesystem::path& path);

  void write(std::string_view text);
  void write(std::span<const std::uint8_t> bytes);
  [[nodiscard]] std::uint64_t size_bytes() const { return size_bytes_; }
  /// Flushes and closes; the error says what could not be written.
  [[nodiscard]] Expected<void> close();

 private:
  struct Closer {
    void operator()(std::FILE* file) const { static_cast<void>(std::fclose(file)); }
  };
  OutputFile(std::FILE* file, std::filesystem::path path) : file_(file), path_(std::move(path)) {}

  std::unique_ptr<std::FILE, Closer> file_;
  std::filesystem::path path_;
  std::uint64_t size_bytes_ = 0;
  int first_errno_ = 0;
};

/// std::snprintf into a string.
[[nodiscard]] [[gnu::format(printf, 1, 2)]] std::string print(const char* format, ...);

}  // namespace roadvec
