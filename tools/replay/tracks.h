#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>

#include "drivers/imu/log_reader.h"
#include "drivers/recording/capture_file.h"
#include "drivers/recording/recording_file.h"
#include "tools/replay/track.h"

namespace roadvec {

/// The packets of one LiDAR, whatever their length: the data port's to one address, the position packets (8308) to
/// another.
class LidarTrack final : public Track {
 public:
  struct Source {
    std::string pcap;
    int port = 0;
    std::optional<std::uint32_t> sender_ipv4;  ///< host byte order; empty: any
  };
  LidarTrack(Source source, std::string destination, UdpOutput data, std::optional<UdpOutput> position);

  Expected<void> rewind() override;
  std::optional<SensorTime> next() override;
  void send(const SendMoment& moment) override;
  bool has_output() const override { return true; }
  bool has_listener() override { return true; }  // a datagram needs none
  std::string destination() const override { return destination_; }

 private:
  [[nodiscard]] bool take(std::span<const std::uint8_t> frame);

  Source source_;
  std::string destination_;
  UdpOutput data_;
  std::optional<UdpOutput> position_;
  std::optional<CaptureFile> file_;
  std::span<const std::uint8_t> payload_;  ///< of the current packet; belongs to file_ until the next one
  bool is_position_ = false;
};

/// The frames of a candump log: to an interface as they are, to a pipe as candump -L lines that carry the date of the
/// replay.
class CanTrack final : public Track {
 public:
  CanTrack(std::string log, std::string destination, std::optional<CanOutput> interface,
           std::optional<PipeOutput> pipe);

  Expected<void> rewind() override;
  std::optional<SensorTime> next() override;
  void send(const SendMoment& moment) override;
  bool has_output() const override { return interface_ || pipe_; }
  bool has_listener() override { return !pipe_ || pipe_->has_listener(); }
  std::string destination() const override { return destination_; }

 private:
  std::string log_, destination_;
  std::optional<CanOutput> interface_;
  std::optional<PipeOutput> pipe_;
  std::optional<RecordingFile> file_;
  CanFrame frame_;
  std::string line_;  ///< of frame_, without its stamp
};

/// The bytes of an imu.log: to a terminal, or a datagram a line.
class ImuTrack final : public Track {
 public:
  ImuTrack(std::string log, std::string destination, std::optional<PtyOutput> terminal, std::optional<UdpOutput> udp);

  Expected<void> rewind() override;
  std::optional<SensorTime> next() override;
  void send(const SendMoment& moment) override;
  bool has_output() const override { return terminal_ || udp_; }
  bool has_listener() override { return !terminal_ || terminal_->has_listener(); }
  std::string destination() const override { return destination_; }

 private:
  std::string log_, destination_;
  std::optional<PtyOutput> terminal_;
  std::optional<UdpOutput> udp_;
  std::optional<RecordingFile> file_;
  std::array<std::uint8_t, kMaxImuLineBytes> bytes_{};
  std::size_t byte_count_ = 0;
};

}  // namespace roadvec
