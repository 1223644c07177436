#include <grp.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>

#include "daemon/server/peer.h"
#include "tests/support/map_socket.h"

namespace roadvec {
namespace {

using Reason = wire::Bye::Reason;
constexpr uid_t kNobody = 65534;

TEST(Peer, is_the_process_at_the_other_end) {
  int ends[2];
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends), 0);
  const FileDescriptor one(ends[0]), other(ends[1]);
  const Peer peer = peer_of(one.get());
  EXPECT_EQ(peer.uid, ::geteuid());
  EXPECT_EQ(peer.gid, ::getegid());
  std::vector<gid_t> groups(static_cast<std::size_t>(::getgroups(0, nullptr)));
  ASSERT_EQ(::getgroups(static_cast<int>(groups.size()), groups.data()), static_cast<int>(groups.size()));
  EXPECT_TRUE(std::ranges::is_permutation(peer.groups, groups));
  EXPECT_TRUE(peer.in_group(::getegid()));
  EXPECT_TRUE(peer.is_owner(::geteuid()));
}

TEST(Peer, of_something_that_is_no_socket_is_nobody) {
  const Peer peer = peer_of(-1);
  EXPECT_FALSE(peer.is_owner(1000));
  EXPECT_FALSE(peer.in_group(1000));
}

TEST(Peer, reads_the_map_as_owner_root_or_member_and_commands_as_owner_or_root) {
  const Peer owner{1000, 1000, {}}, root{0, 0, {}}, member{1001, 1001, {4, 77, 9}}, primary{1002, 77, {}},
      other{1003, 1003, {}};
  const Gate map{1000, gid_t{77}, false}, open_map{1000, std::nullopt, false}, control{1000, gid_t{77}, true};
  for (const Peer& peer : {owner, root, member, primary}) EXPECT_TRUE(map.admits(peer)) << peer.uid;
  EXPECT_FALSE(map.admits(other));
  EXPECT_TRUE(open_map.admits(other)) << "the socket's file mode has let it through";
  for (const Peer& peer : {owner, root}) EXPECT_TRUE(control.admits(peer)) << peer.uid;
  for (const Peer& peer : {member, primary, other}) EXPECT_FALSE(control.admits(peer)) << peer.uid;
}

TEST(Peer, a_group_has_a_number_or_an_error_that_names_it) {
  ASSERT_TRUE(group_of("root"));
  EXPECT_EQ(*group_of("root"), 0U);
  const auto missing = group_of("no-such-group");
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().message.find("'no-such-group'"), std::string::npos);
}

class WhoMayConnect : public MapSocket {
 protected:
  WhoMayConnect() {
    config_.control_path = (folder_ / "control.sock").string();
    config_.facts.commands.durable_seq = [this] { return durable_seq_.load(); };
    config_.facts.commands.begin_new_map = [this] { new_map_wanted_ = true; };
  }
  [[nodiscard]] Expected<MapClient> connect_as_owner() {
    return MapClient::connect(config_.control_path, "test", kPatience);
  }
  /// Ten changes, and an owner who has them all.
  void start_with_a_following_owner() {
    start();
    publish(10);
    Expected<MapClient> connected = connect_as_owner();
    ASSERT_TRUE(connected) << connected.error().message;
    owner_.emplace(std::move(*connected));
    ASSERT_TRUE(owner_->send(wire::Subscribe{}));
    follow(*owner_, replica_, head_seq());
  }
  [[nodiscard]] static wire::Error error_in_place_of_answer(MapClient& client) {
    while (true) {
      const auto message = client.receive(kPatience);
      if (!message) return {};
      if (const auto* error = std::get_if<wire::Error>(&*message)) return *error;
    }
  }
  /// What the server says to a process of another user, which has connected before it became one. Only root can.
  [[nodiscard]] int bye_for_nobody(const std::string& path) {
    ::chmod(folder_.path().c_str(), 0755);
    ::chmod(path.c_str(), 0666);
    const pid_t child = ::fork();
    if (child == 0) {
      if (::setgroups(0, nullptr) != 0 || ::setgid(kNobody) != 0 || ::setuid(kNobody) != 0) ::_exit(100);
      Expected<MapClient> client = MapClient::open(path);
      if (!client) ::_exit(101);
      const Expected<wire::Bye> bye = client->receive_one<wire::Bye>(kPatience);
      ::_exit(bye ? static_cast<int>(bye->reason) : 102);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    return WEXITSTATUS(status);
  }

  std::atomic<std::uint64_t> durable_seq_{0};
  std::atomic<bool> new_map_wanted_{false};
  std::optional<MapClient> owner_;
  wire::MapReplica replica_;
};

TEST_F(WhoMayConnect, one_users_clients_are_limited_and_told_so) {
  config_.most_clients_per_user = 2;
  start();
  MapClient first = connect(), second = connect();
  Expected<MapClient> third = MapClient::open(config_.socket_path);
  ASSERT_TRUE(third);
  const wire::Bye bye = farewell(*third);
  EXPECT_EQ(bye.reason, Reason::too_many_clients);
  EXPECT_NE(bye.text.find("of one user"), std::string::npos) << bye.text;
  EXPECT_TRUE(connect_as_owner()) << "the owner's socket is not counted with them";
}

TEST_F(WhoMayConnect, the_status_says_how_many_each_user_has_connected) {
  start();
  MapClient first = connect(), second = connect();
  const std::string mine = "clients_of_uid_" + std::to_string(::geteuid());
  double found = 0;
  for (int i = 0; i < 100 && found != 2; ++i) {
    ASSERT_TRUE(first.send(wire::GetStatus{}));
    const auto status = first.receive_one<wire::Status>(kPatience);
    ASSERT_TRUE(status) << status.error().message;
    for (const wire::Gauge& gauge : status->stages.back().gauges) found = gauge.name == mine ? gauge.value : found;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  EXPECT_EQ(found, 2);
}

TEST_F(WhoMayConnect, a_group_that_does_not_exist_is_a_reason_not_to_start) {
  config_.group = "no-such-group";
  EXPECT_THROW(start(), std::runtime_error);
}

TEST_F(WhoMayConnect, strangers_are_turned_away_from_both_sockets) {
  config_.group = "root";
  if (::geteuid() != 0) config_.group = ::getgrgid(::getegid())->gr_name;
  start();
  struct stat map {
  }, control{};
  ASSERT_EQ(::stat(config_.socket_path.c_str(), &map), 0);
  ASSERT_EQ(::stat(config_.control_path.c_str(), &control), 0);
  EXPECT_EQ(map.st_mode & 0777U, 0660U);
  EXPECT_EQ(map.st_gid, ::getegid());
  EXPECT_EQ(control.st_mode & 0777U, 0600U);
  EXPECT_NO_THROW((void)connect());
  if (::geteuid() != 0) return;
  EXPECT_EQ(bye_for_nobody(config_.socket_path), static_cast<int>(Reason::not_authorised));
  EXPECT_EQ(bye_for_nobody(config_.control_path), static_cast<int>(Reason::not_authorised));
  EXPECT_EQ(closed(Reason::not_authorised), 2U);
}

TEST_F(WhoMayConnect, a_command_on_the_map_socket_is_refused) {
  start();
  MapClient client = connect();
  ASSERT_TRUE(client.send(wire::Command{std::nullopt, wire::NewMap{}, std::nullopt}));
  EXPECT_EQ(error_in_place_of_answer(client).code, wire::Error::Code::not_authorised);
  EXPECT_FALSE(new_map_wanted_);
}

TEST_F(WhoMayConnect, a_save_is_answered_when_the_changes_so_far_are_on_disk) {
  start_with_a_following_owner();
  ASSERT_TRUE(owner_->send(wire::Command{wire::Save{}, std::nullopt, std::nullopt}));
  ASSERT_TRUE(owner_->send(wire::Ping{1}));
  durable_seq_ = 9;
  publish(5);
  follow(*owner_, replica_, head_seq());  // changes come meanwhile
  EXPECT_FALSE(owner_->receive_one<wire::CommandResult>(MapClient::Seconds(0.1)));
  durable_seq_ = head_seq();
  const auto result = owner_->receive_one<wire::CommandResult>(kPatience);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_TRUE(result->done);
  EXPECT_EQ(result->durable_seq, head_seq());
  EXPECT_TRUE(owner_->receive_one<wire::Pong>(kPatience)) << "answered in order";
}

TEST_F(WhoMayConnect, a_save_is_refused_at_once_while_nothing_can_be_written) {
  config_.facts.commands.cannot_save = [] { return std::string("disk full: make room"); };
  start_with_a_following_owner();
  ASSERT_TRUE(owner_->send(wire::Command{wire::Save{}, std::nullopt, std::nullopt}));
  const auto result = owner_->receive_one<wire::CommandResult>(kPatience);
  ASSERT_TRUE(result) << result.error().message;
  EXPECT_FALSE(result->done);
  EXPECT_EQ(result->text, "disk full: make room");
  durable_seq_ = head_seq();
  ASSERT_TRUE(owner_->send(wire::Command{wire::Save{}, std::nullopt, std::nullopt}));
  EXPECT_TRUE(owner_->receive_one<wire::CommandResult>(kPatience)->done) << "all was on disk before";
}

TEST_F(WhoMayConnect, who_is_dismissed_is_named_in_the_log_and_a_crowd_only_counted) {
  config_.most_clients_per_user = 1;
  std::vector<std::string> lines;
  config_.log = [&lines](const std::string& line) { lines.push_back(line); };  // read after stop()
  start();
  MapClient first = connect();
  for (int i = 0; i < 40; ++i) {
    Expected<MapClient> refused = MapClient::open(config_.socket_path);
    ASSERT_TRUE(refused);
    EXPECT_EQ(farewell(*refused).reason, Reason::too_many_clients);
  }
  ASSERT_TRUE(first.send(wire::GetStatus{}));
  while (true) {
    const auto status = first.receive_one<wire::Status>(kPatience);
    ASSERT_TRUE(status) << status.error().message;
    if (status->state == "degraded" && status->stages.back().state == "crowded") break;
    ASSERT_TRUE(first.send(wire::GetStatus{}));
  }
  stop();
  ASSERT_GE(lines.size(), 5U);
  EXPECT_LT(lines.size(), 40U);
  const std::string whom = "client of uid " + std::to_string(::geteuid()) + ", pid " + std::to_string(::getpid());
  EXPECT_EQ(lines[0], whom + " dismissed: at most 1 clients of one user");
  EXPECT_NE(lines[4].find("only counted"), std::string::npos) << lines[4];
}

TEST_F(WhoMayConnect, what_a_follower_has_taken_is_told_once_and_what_nobody_follows_is_let_go) {
  std::atomic<std::uint64_t> let_go{0}, taken{0};
  config_.on_written = [&](std::uint64_t seq, bool by_somebody) { (by_somebody ? taken : let_go) = seq; };
  start();
  publish(10);
  while (let_go < head_seq()) std::this_thread::yield();
  EXPECT_EQ(taken, 0U);
  MapClient follower = connect(), second = connect();
  wire::MapReplica replica, other;
  ASSERT_TRUE(follower.send(wire::Subscribe{}));
  follow(follower, replica, head_seq());
  ASSERT_TRUE(second.send(wire::Subscribe{}));
  follow(second, other, head_seq());
  const std::uint64_t before = let_go;
  publish(10);
  follow(follower, replica, head_seq());
  while (taken < head_seq()) std::this_thread::yield();
  EXPECT_EQ(let_go, before);
}

TEST_F(WhoMayConnect, a_new_map_is_announced_with_its_reason_and_begins_empty) {
  start();
  publish(30);
  MapClient client = connect();
  ASSERT_TRUE(client.send(wire::Subscribe{}));
  wire::MapReplica replica;
  follow(client, replica, head_seq());
  Expected<MapClient> owner = connect_as_owner();
  ASSERT_TRUE(owner);
  ASSERT_TRUE(owner->send(wire::Command{std::nullopt, wire::NewMap{}, std::nullopt}));
  while (!new_map_wanted_) std::this_thread::yield();
  MapChange forget;
  forget.begins_anew = true;
  for (const auto& [id, line] : story_.map()) forget.removed.push_back(id);
  publisher_->publish(forget, {}, [](std::size_t) {});
  EXPECT_TRUE(owner->receive_one<wire::CommandResult>(kPatience));
  const auto change = client.receive_one<wire::EpochChange>(kPatience);
  ASSERT_TRUE(change) << change.error().message;
  EXPECT_EQ(change->reason, wire::EpochChange::Reason::map_replaced);
  ASSERT_EQ(replica.apply(*change), wire::MapReplica::Outcome::applied);
  follow(client, replica, head_seq());
  EXPECT_TRUE(replica.lines().empty());
  EXPECT_EQ(replica.epoch(), kStart.epoch + 1);
}

TEST_F(WhoMayConnect, a_command_that_cannot_be_carried_out_is_refused_with_the_reason) {
  config_.facts.commands = {};
  start();
  Expected<MapClient> owner = connect_as_owner();
  ASSERT_TRUE(owner);
  for (const wire::Command& command :
       {wire::Command{wire::Save{}, std::nullopt, std::nullopt},
        wire::Command{std::nullopt, wire::NewMap{}, std::nullopt},
        wire::Command{std::nullopt, std::nullopt, wire::ImportMap{"/tmp/map.gpkg"}}, wire::Command{}}) {
    ASSERT_TRUE(owner->send(command));
    EXPECT_EQ(error_in_place_of_answer(*owner).code, wire::Error::Code::unsupported);
  }
  ASSERT_TRUE(owner->send(wire::Command{wire::Save{}, wire::NewMap{}, std::nullopt}));
  EXPECT_EQ(error_in_place_of_answer(*owner).code, wire::Error::Code::invalid);
}

}  // namespace
}  // namespace roadvec
