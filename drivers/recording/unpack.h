#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "core/base/error.h"

namespace roadvec {

/// The bytes of a compressed file, unpacked while they are read.
class Unpack {
 public:
  virtual ~Unpack() = default;
  /// How many bytes were written to the front of `bytes`; 0 at the end, or when something is wrong: see problem().
  [[nodiscard]] virtual std::size_t read(std::span<char> bytes) noexcept = 0;
  [[nodiscard]] const std::string& problem() const { return problem_; }  ///< empty: none
  [[nodiscard]] bool cut_off() const { return cut_off_; }                ///< the file ends before its compressed data

 protected:
  std::string problem_;
  bool cut_off_ = false;
};

/// What `path` is compressed with, by its first bytes: gzip or zstd. Null: neither, read it as it is.
[[nodiscard]] Expected<std::unique_ptr<Unpack>> open_compressed(const std::filesystem::path& path);

}  // namespace roadvec
