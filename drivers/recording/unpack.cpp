#include "drivers/recording/unpack.h"

#include <zlib.h>
#include <zstd.h>

#include <array>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <vector>

namespace roadvec {
namespace {

/// Captures of LiDARs shrink two- to tenfold. What grows by more than this, and to more than that, is no capture.
constexpr std::uint64_t kMostGrowth = 250, kGrowthIsFine_bytes = 16 << 20;

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

/// Reads the compressed bytes and watches how they grow; the formats differ in step().
class StreamUnpack : public Unpack {
 public:
  explicit StreamUnpack(File file) : file_(std::move(file)), input_(kInputBytes) {}

  std::size_t read(std::span<char> bytes) noexcept final {
    std::size_t count = 0;
    while (count < bytes.size() && problem_.empty()) {
      const std::size_t before = begin_;
      const std::size_t written = step(bytes.subspan(count));
      count += written;
      unpacked_bytes_ += written;
      if (unpacked_bytes_ > kGrowthIsFine_bytes && unpacked_bytes_ / kMostGrowth > packed_bytes_) {
        problem_ = "grows more than " + std::to_string(kMostGrowth) + "-fold when unpacked: not a capture";
      }
      if (written > 0 || begin_ != before || !problem_.empty()) continue;
      if (fill()) continue;
      if (!between_members()) cut_off_ = true, problem_ = "the compressed data are cut off";
      break;
    }
    return count;
  }

 protected:
  /// Takes bytes off the input and writes some; neither when it needs more input.
  virtual std::size_t step(std::span<char> bytes) noexcept = 0;
  /// The input may end here.
  [[nodiscard]] virtual bool between_members() const noexcept = 0;

  static constexpr std::size_t kInputBytes = 1 << 16;
  File file_;
  std::vector<unsigned char> input_;
  std::size_t begin_ = 0, end_ = 0;  ///< what is read and not used is [begin_, end_)

 private:
  bool fill() noexcept {
    std::memmove(input_.data(), input_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    begin_ = 0;
    const std::size_t count = std::fread(input_.data() + end_, 1, input_.size() - end_, file_.get());
    if (count == 0 && std::ferror(file_.get()) != 0) problem_ = std::string("cannot be read: ") + std::strerror(errno);
    end_ += count;
    packed_bytes_ += count;
    return count > 0;
  }

  std::uint64_t packed_bytes_ = 0, unpacked_bytes_ = 0;
};

class Gunzip final : public StreamUnpack {
 public:
  explicit Gunzip(File file) : StreamUnpack(std::move(file)) {
    constexpr int kGzipOnly = 16 + MAX_WBITS;
    if (::inflateInit2(&stream_, kGzipOnly) != Z_OK) problem_ = "no memory to unpack it";
  }
  ~Gunzip() override { ::inflateEnd(&stream_); }
  Gunzip(const Gunzip&) = delete;
  Gunzip& operator=(const Gunzip&) = delete;

 private:
  std::size_t step(std::span<char> bytes) noexcept override {
    stream_.next_in = input_.data() + begin_;
    stream_.avail_in = static_cast<uInt>(end_ - begin_);
    stream_.next_out = reinterpret_cast<Bytef*>(bytes.data());
    stream_.avail_out = static_cast<uInt>(bytes.size());
    if (stream_.avail_in > 0) inside_ = true;
    const int result = ::inflate(&stream_, Z_NO_FLUSH);
    begin_ = end_ - stream_.avail_in;
    const std::size_t written = bytes.size() - stream_.avail_out;
    if (result == Z_STREAM_END) {
      inside_ = false;
      ::inflateReset(&stream_);  // another member may follow
    } else if (result != Z_OK && result != Z_BUF_ERROR) {
      problem_ = std::string("the gzip data are damaged (") + (stream_.msg != nullptr ? stream_.msg : "zlib") + ")";
    }
    return written;
  }
  bool between_members() const noexcept override { return !inside_; }

  z_stream stream_{};
  bool inside_ = true;
};

class Unzstd final : public StreamUnpack {
 public:
  explicit Unzstd(File file) : StreamUnpack(std::move(file)), stream_(ZSTD_createDStream(), ZSTD_freeDStream) {
    if (!stream_) problem_ = "no memory to unpack it";
  }

 private:
  std::size_t step(std::span<char> bytes) noexcept override {
    ZSTD_inBuffer input{input_.data(), end_, begin_};
    ZSTD_outBuffer output{bytes.data(), bytes.size(), 0};
    const std::size_t result = ZSTD_decompressStream(stream_.get(), &output, &input);
    if (ZSTD_isError(result) != 0) {
      problem_ = std::string("the zstd data are damaged (") + ZSTD_getErrorName(result) + ")";
    } else if (input.pos != begin_ || output.pos > 0) {
      inside_ = result != 0;
    }
    begin_ = input.pos;
    return output.pos;
  }
  bool between_members() const noexcept override { return !inside_; }

  std::unique_ptr<ZSTD_DStream, std::size_t (*)(ZSTD_DStream*)> stream_;
  bool inside_ = true;
};

}  // namespace

Expected<std::unique_ptr<Unpack>> open_compressed(const std::filesystem::path& path) {
  File file(std::fopen(path.c_str(), "rbe"), std::fclose);
  if (!file) return fail(path.string() + ": cannot be read (" + std::strerror(errno) + "); check the path");
  std::array<unsigned char, 4> magic{};
  const std::size_t count = std::fread(magic.data(), 1, magic.size(), file.get());
  std::rewind(file.get());
  constexpr std::array<unsigned char, 2> kGzip{0x1F, 0x8B};
  constexpr std::array<unsigned char, 4> kZstd{0x28, 0xB5, 0x2F, 0xFD};
  if (count >= 2 && std::memcmp(magic.data(), kGzip.data(), 2) == 0) return std::make_unique<Gunzip>(std::move(file));
  if (count == 4 && magic == kZstd) return std::make_unique<Unzstd>(std::move(file));
  return std::unique_ptr<Unpack>();
}

}  // namespace roadvec
