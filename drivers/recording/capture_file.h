#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "core/base/error.h"
#include "core/base/time.h"
#include "drivers/recording/frame.h"

struct pcap;

namespace roadvec {

/// A capture read frame by frame: pcap in microseconds or nanoseconds, pcapng; plain, gzip or zstd, told apart by their
/// first bytes and unpacked while reading. One record's memory, however long the file.
class CaptureFile {
 public:
  enum class Next : std::uint8_t {
    frame,
    end,
    cut_off,  ///< the file ends inside a record, as one does that was still being written: see problem()
    failed,   ///< damaged: see problem()
  };
  struct Frame {
    SensorTime time;                      ///< from 1970 to 2242, so that no later difference of two times can overflow
    std::span<const std::uint8_t> bytes;  ///< valid until the next call
    std::size_t sent_bytes = 0;           ///< more than bytes.size(): the capture kept only the beginning
  };

  /// The error names the file.
  [[nodiscard]] static Expected<CaptureFile> open(const std::filesystem::path& path);
  CaptureFile(CaptureFile&&) noexcept;
  CaptureFile& operator=(CaptureFile&&) noexcept;
  ~CaptureFile();

  [[nodiscard]] Next next(Frame& frame) noexcept;
  [[nodiscard]] LinkLayer link() const { return link_; }
  [[nodiscard]] int snap_bytes() const;                                  ///< what the capture kept of a frame at most
  [[nodiscard]] const std::string& problem() const { return problem_; }  ///< one line that names the file

 private:
  struct Close {
    void operator()(pcap* file) const;
  };
  struct Unpacker;
  CaptureFile(std::unique_ptr<Unpacker> unpacker, pcap* file, LinkLayer link, std::string name);

  std::unique_ptr<Unpacker> unpacker_;  ///< null: the file is not compressed. Outlives file_, which reads from it
  std::unique_ptr<pcap, Close> file_;
  LinkLayer link_;
  std::string name_, problem_;
};

}  // namespace roadvec
