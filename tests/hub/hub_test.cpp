#include "hub/hub.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <filesystem>
#include <thread>

#include "proto/control/link.hpp"
#include "tests/hub/control/support/folder.hpp"
#include "tests/hub/control/support/peer.hpp"

namespace gimnet::hub {
namespace {

using ::testing::HasSubstr;
using ::testing::MatchesRegex;

HubOptions options(const TestFolder& folder, const std::vector<std::string>& urls) {
  HubOptions result;
  result.state_dir = folder.path("state");
  result.name = "test";
  result.shards = 2;
  for (const std::string& url : urls) result.listen.push_back(*parse_listen_url(url));
  return result;
}

/// Dials, says HELLO and returns the descriptor once WELCOME is there; -1 if anything is otherwise.
int dial_and_greet(const std::string& path) {
  const int descriptor = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const timeval patience{10, 0};
  ::setsockopt(descriptor, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
  if (::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    return -1;
  const std::vector<std::byte> hello = opening_and(proto::Hello{});
  if (::send(descriptor, hello.data(), hello.size(), MSG_NOSIGNAL) < 0) return -1;
  std::byte answer[1024];
  const ssize_t size = ::recv(descriptor, answer, sizeof answer, 0);
  constexpr std::size_t kBefore = proto::kOpeningSize + proto::kHeaderSize;
  if (size < static_cast<ssize_t>(kBefore)) return -1;
  const std::span<const std::byte> payload =
      std::span{answer, static_cast<std::size_t>(size)}.subspan(kBefore);
  return proto::decode<proto::Welcome>(payload) ? descriptor : -1;
}

/// Waits for GOODBYE and the end of the connection.
bool reads_goodbye(int descriptor) {
  std::vector<std::byte> all;
  std::byte block[1024];
  for (;;) {
    const ssize_t count = ::recv(descriptor, block, sizeof block, 0);
    if (count < 0) return false;
    if (count == 0) break;
    all.insert(all.end(), block, block + count);
  }
  if (all.size() < proto::kHeaderSize) return false;
  const auto goodbye = proto::decode<proto::Goodbye>(std::span{all}.subspan(proto::kHeaderSize));
  return goodbye && goodbye->code == proto::GoodbyeCode::draining;
}

bool is_over(int descriptor, int patience_ms) {
  pollfd end{descriptor, 0, 0};
  return ::poll(&end, 1, patience_ms) == 1;
}

TEST(Hub, SaysWhereItListens) {
  const TestFolder folder;
  const auto hub = Hub::start(options(folder, {"tcp://127.0.0.1:0", "unix:" + folder.path("s")}));
  ASSERT_TRUE(hub);
  EXPECT_THAT((*hub)->addresses(), MatchesRegex("tcp://127\\.0\\.0\\.1:[1-9][0-9]* unix:.*/s"));
}

TEST(Hub, DoesNotStartWhereItCannotListen) {
  const TestFolder folder;
  const auto hub = Hub::start(options(folder, {"unix:" + folder.path("none/s")}));
  ASSERT_FALSE(hub);
  EXPECT_THAT(hub.error().sentence, HasSubstr("does not exist"));
}

TEST(Hub, DoesNotStartWithoutItsStateFolder) {
  const TestFolder folder;
  HubOptions wanted = options(folder, {"unix:" + folder.path("s")});
  wanted.state_dir = folder.path("none/state");
  EXPECT_FALSE(Hub::start(wanted));
}

TEST(Hub, WelcomesNodesAndDrainsAtASignal) {
  const TestFolder folder;
  auto hub = Hub::start(options(folder, {"unix:" + folder.path("s")}));
  ASSERT_TRUE(hub);
  bool greeted = false;
  bool dismissed = false;
  std::thread node([&] {
    const int descriptor = dial_and_greet(folder.path("s"));
    greeted = descriptor >= 0;
    ::kill(::getpid(), SIGTERM);
    dismissed = greeted && reads_goodbye(descriptor);
    ::close(descriptor);
  });
  (*hub)->run();
  node.join();
  EXPECT_TRUE(greeted);
  EXPECT_TRUE(dismissed);
  *hub = nullptr;
  EXPECT_FALSE(std::filesystem::exists(folder.path("s")));
}

// A hub that ended with bytes of a node unread would reset the connection, and take GOODBYE with
// it.
TEST(Hub, EndsWhenThoseWhomItToldGoodbyeHaveLeft) {
  const TestFolder folder;
  HubOptions wanted = options(folder, {"unix:" + folder.path("s")});
  wanted.limits.farewell_ms = 60'000;
  auto hub = Hub::start(wanted);
  ASSERT_TRUE(hub);
  bool ended_early = true;
  bool dismissed = false;
  std::thread node([&] {
    const int descriptor = dial_and_greet(folder.path("s"));
    ::kill(::getpid(), SIGTERM);
    pollfd goodbye{descriptor, POLLIN, 0};
    if (::poll(&goodbye, 1, 60'000) == 1) {
      const std::byte late[1'000]{};
      static_cast<void>(::send(descriptor, late, sizeof late, MSG_NOSIGNAL));
      ended_early = is_over(descriptor, 1'000);
      dismissed = reads_goodbye(descriptor);
    }
    ::close(descriptor);
  });
  (*hub)->run();
  *hub = nullptr;  // closes what it still has
  node.join();
  EXPECT_FALSE(ended_early);
  EXPECT_TRUE(dismissed);
}

}  // namespace
}  // namespace gimnet::hub
