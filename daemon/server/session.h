#pragma once

#include <deque>
#include <optional>
#include <set>

#include "core/wire/frame_assembler.h"
#include "daemon/server/file_descriptor.h"
#include "daemon/server/peer.h"
#include "daemon/server/served_map.h"

namespace roadvec {

/// One client's connection: bytes in, frames out, and how far it has come. Times are seconds on a steady clock, given
/// by the caller.
class Session {
 public:
  enum class State { awaiting_hello, greeted, leaving, closed };

  /// What a subscriber wants and how far it is.
  struct Following {
    std::optional<wire::Area> area;
    std::uint64_t seq = 0;  ///< newest change it was sent
    double interval_s = 0;  ///< least time between two batches of changes, and between two poses
    bool poses = false, status = false;
    double next_changes_s = 0, next_pose_s = 0;
  };

  /// Tiles that it is still to be sent: their names alone, so that a client that reads slowly costs no copy of the map.
  struct Delivery {
    bool answers = false;  ///< GetTiles, in Tiles frames; else a snapshot or what an overrun lost, in Tile frames
    std::optional<wire::Area> area;
    std::set<TileKey> named;    ///< none: all of the area
    std::vector<TileKey> keys;  ///< to be sent, the last one first
    MapHead cut;                ///< the map as of which they and those that were sent are
    [[nodiscard]] bool covers(TileKey key) const {
      return (!area || area->touches(key)) && (named.empty() || named.contains(key));
    }
  };

  /// The end of its command.
  struct Awaited {
    enum class What : std::uint8_t { saved, new_map } what;
    std::uint64_t seq = 0;  ///< the map's head when it came
  };

  Session(FileDescriptor socket, Peer peer, double now_s)
      : socket_(std::move(socket)), peer_(std::move(peer)), since_s_(now_s), input_(wire::kMostClientBytes) {}

  [[nodiscard]] int fd() const { return socket_.get(); }
  [[nodiscard]] const Peer& peer() const { return peer_; }
  /// Nothing waits in either direction: requests are answered one by one, so that a client that asks and does not read
  /// stops itself.
  [[nodiscard]] bool wants_input() const {
    return output_.empty() && !delivery && !awaited && state != State::leaving && !input_.has_envelope();
  }
  /// Reads once what has come. false: the other side is gone.
  [[nodiscard]] bool receive(double now_s);
  [[nodiscard]] wire::FrameAssembler& input() { return input_; }
  void queue(SharedFrame frame, double now_s);
  /// Sends as much as the socket takes. false: the other side is gone.
  [[nodiscard]] bool send(double now_s);
  [[nodiscard]] bool has_output() const { return !output_.empty(); }
  [[nodiscard]] std::size_t waiting_bytes() const;

  /// Queues a last frame after the one that is being sent; whatever else waits is dropped.
  void leave(SharedFrame bye, double now_s);
  /// Whoever has neither read for this long while frames wait nor finished a frame it began.
  [[nodiscard]] bool stalled(double now_s, double limit_s) const {
    return has_output() && now_s - progress_s_ > limit_s;
  }
  [[nodiscard]] bool half_frame(double now_s, double limit_s) const {
    return !has_output() && !awaited && input_.has_bytes() && now_s - input_progress_s_ > limit_s;
  }
  [[nodiscard]] double since_s() const { return since_s_; }  ///< when the state was entered
  void enter(State next, double now_s) {
    state = next;
    since_s_ = now_s;
  }
  /// A whole frame was taken, so the next one has its own time.
  void frame_taken(double now_s) { input_progress_s_ = now_s; }

  State state = State::awaiting_hello;
  std::optional<Following> following;
  std::optional<Delivery> delivery;
  bool is_owner = false;                          ///< it came by the control socket, so it may command
  std::optional<Awaited> awaited;                 ///< of its Command
  std::uint64_t sent_bytes = 0, sent_frames = 0;  ///< taken by the owner into its counters

 private:
  FileDescriptor socket_;
  Peer peer_;
  double since_s_;
  wire::FrameAssembler input_;
  double input_progress_s_ = 0;
  std::deque<SharedFrame> output_;
  std::size_t sent_of_front_ = 0;
  bool was_full_ = false;  ///< the socket took no more, so we did not read
  double progress_s_ = 0;
};

}  // namespace roadvec
