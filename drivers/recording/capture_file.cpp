#include "drivers/recording/capture_file.h"

#include <pcap/pcap.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <string_view>

#include "drivers/recording/unpack.h"

namespace roadvec {
namespace {

std::optional<LinkLayer> link_layer_of(int data_link) {
  switch (data_link) {
    case DLT_EN10MB:
      return LinkLayer::ethernet;
    case DLT_LINUX_SLL:
      return LinkLayer::linux_cooked;
    case DLT_LINUX_SLL2:
      return LinkLayer::linux_cooked2;
    case DLT_RAW:
    case DLT_IPV4:
      return LinkLayer::raw_ip;
    case DLT_CAN_SOCKETCAN:
      return LinkLayer::socketcan;
    case DLT_NULL:
    case DLT_LOOP:
      return LinkLayer::loopback;
    default:
      return std::nullopt;
  }
}

SensorTime time_of(const pcap_pkthdr& header) {
  const auto seconds = std::clamp<std::int64_t>(header.ts.tv_sec, 0, std::int64_t{1} << 33);
  const auto nanoseconds =
      std::clamp<std::int64_t>(header.ts.tv_usec, 0, 999'999'999);  // libpcap was asked for nanoseconds
  return {seconds * 1'000'000'000 + nanoseconds};
}

}  // namespace

/// The compressed file as one that libpcap can read.
struct CaptureFile::Unpacker {
  explicit Unpacker(std::unique_ptr<Unpack> from) : unpack(std::move(from)) {}
  /// The stream belongs to whoever takes it; null: no memory.
  std::FILE* stream() {
    const auto read = [](void* self, char* bytes, std::size_t count) -> ssize_t {
      Unpack& from = *static_cast<Unpacker*>(self)->unpack;
      const std::size_t taken = from.read({bytes, count});
      return taken == 0 && !from.problem().empty() && !from.cut_off() ? -1 : static_cast<ssize_t>(taken);
    };
    return ::fopencookie(this, "r", {.read = read, .write = nullptr, .seek = nullptr, .close = nullptr});
  }
  std::unique_ptr<Unpack> unpack;
};

void CaptureFile::Close::operator()(pcap* file) const { pcap_close(file); }
CaptureFile::CaptureFile(CaptureFile&&) noexcept = default;
CaptureFile& CaptureFile::operator=(CaptureFile&&) noexcept = default;
CaptureFile::~CaptureFile() = default;

CaptureFile::CaptureFile(std::unique_ptr<Unpacker> unpacker, pcap* file, LinkLayer link, std::string name)
    : unpacker_(std::move(unpacker)), file_(file), link_(link), name_(std::move(name)) {}

Expected<CaptureFile> CaptureFile::open(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) return fail(path.string() + ": no such file; check the path");
  auto unpack = open_compressed(path);
  if (!unpack) return tl::unexpected(unpack.error());
  std::unique_ptr<Unpacker> unpacker;
  std::FILE* stream = nullptr;
  if (*unpack) {
    unpacker = std::make_unique<Unpacker>(std::move(*unpack));
    stream = unpacker->stream();
  } else {
    stream = std::fopen(path.c_str(), "rbe");
  }
  std::array<char, PCAP_ERRBUF_SIZE> why{"cannot be opened"};
  pcap* const file = stream == nullptr
                         ? nullptr
                         : pcap_fopen_offline_with_tstamp_precision(stream, PCAP_TSTAMP_PRECISION_NANO, why.data());
  if (file == nullptr) {
    if (stream != nullptr) std::fclose(stream);
    if (unpacker && !unpacker->unpack->problem().empty()) {
      return fail(path.string() + ": " + unpacker->unpack->problem() + "; copy or capture it anew");
    }
    return fail(path.string() + ": not a pcap that can be read (" + why.data() +
                "); capture with tcpdump or Wireshark");
  }
  const std::optional<LinkLayer> link = link_layer_of(pcap_datalink(file));
  if (!link) {
    const char* const name = pcap_datalink_val_to_name(pcap_datalink(file));
    const std::string layer = name != nullptr ? name : std::to_string(pcap_datalink(file));
    pcap_close(file);
    return fail(path.string() + ": link layer " + layer + " is not supported; capture on an Ethernet interface");
  }
  return CaptureFile(std::move(unpacker), file, *link, path.string());
}

int CaptureFile::snap_bytes() const { return pcap_snapshot(file_.get()); }

CaptureFile::Next CaptureFile::next(Frame& frame) noexcept {
  pcap_pkthdr* header = nullptr;
  const u_char* bytes = nullptr;
  const int result = pcap_next_ex(file_.get(), &header, &bytes);
  if (result == 1) {
    frame = {time_of(*header), {bytes, header->caplen}, header->len};
    return Next::frame;
  }
  const Unpack* const unpack = unpacker_ ? unpacker_->unpack.get() : nullptr;
  if (unpack != nullptr && !unpack->problem().empty() && !unpack->cut_off()) {
    problem_ = name_ + ": " + unpack->problem() + "; what lies before was read";
    return Next::failed;
  }
  const bool ended_early = std::feof(pcap_file(file_.get())) != 0;
  if (result == PCAP_ERROR_BREAK && (unpack == nullptr || !unpack->cut_off())) return Next::end;
  if (ended_early) {
    problem_ = name_ + ": cut off inside its last record, as if still being written; what lies before was read";
    return Next::cut_off;
  }
  problem_ = name_ + ": damaged (" + pcap_geterr(file_.get()) + "); what lies before was read";
  return Next::failed;
}

}  // namespace roadvec
