#include "daemon/server/listener.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "daemon/server/client.h"
#include "tests/support/temporary_folder.h"

namespace roadvec {
namespace {

class ListenerTest : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  std::string path_ = (folder_ / "map.sock").string();
};

TEST_F(ListenerTest, has_the_mode_it_was_given_and_removes_its_file) {
  {
    const Listener listener(path_, 0640, -1);
    struct stat found {};
    ASSERT_EQ(::stat(path_.c_str(), &found), 0);
    EXPECT_EQ(found.st_mode & 0777U, 0640U);
  }
  EXPECT_FALSE(std::filesystem::exists(path_));
}

TEST_F(ListenerTest, replaces_a_socket_file_that_nobody_listens_on) {
  {
    // What a killed daemon leaves behind: the file, moved away and back so that the first listener does not remove it.
    const Listener killed(path_, 0600, -1);
    std::filesystem::rename(path_, path_ + ".left");
  }
  std::filesystem::rename(path_ + ".left", path_);
  const Listener listener(path_, 0600, -1);
  EXPECT_TRUE(MapClient::open(path_));
}

TEST_F(ListenerTest, refuses_a_path_that_a_live_daemon_uses) {
  const Listener first(path_, 0600, -1);
  try {
    const Listener second(path_, 0600, -1);
    FAIL() << "two listeners on one path";
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("in use by another process"), std::string::npos) << e.what();
  }
  EXPECT_TRUE(MapClient::open(path_)) << "the first one still listens";
}

TEST_F(ListenerTest, does_not_touch_a_file_that_is_not_a_socket) {
  std::ofstream(path_) << "precious";
  EXPECT_THROW(Listener(path_, 0600, -1), std::runtime_error);
  EXPECT_EQ(std::filesystem::file_size(path_), 8U);
}

TEST_F(ListenerTest, names_the_path_in_its_errors) {
  EXPECT_THROW(Listener(std::string(200, 'x'), 0600, -1), std::runtime_error);
  try {
    const Listener listener((folder_ / "missing/map.sock").string(), 0600, -1);
    FAIL();
  } catch (const std::runtime_error& e) {
    EXPECT_NE(std::string(e.what()).find("missing/map.sock"), std::string::npos);
  }
}

TEST_F(ListenerTest, an_adopted_socket_keeps_its_file) {
  {
    const Listener giver(path_, 0600, -1);
    const Listener adopted("", 0600, ::dup(giver.fd()));
    EXPECT_TRUE(MapClient::open(path_));
    EXPECT_GE(adopted.accept().get(), 0);
    EXPECT_LT(adopted.accept().get(), 0) << "non-blocking";
  }
  EXPECT_FALSE(std::filesystem::exists(path_));
}

}  // namespace
}  // namespace roadvec
