#include "hub/control/listener.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/hub/control/support/folder.hpp"

namespace gimnet::hub {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

ListenUrl url(const std::string& text) { return *parse_listen_url(text); }

TEST(Listener, PortZeroBecomesARealOne) {
  const auto listener = Listener::open(url("tcp://127.0.0.1:0"));
  ASSERT_TRUE(listener);
  EXPECT_NE((*listener)->url().port, 0);
  EXPECT_GE((*listener)->descriptor(), 0);
}

TEST(Listener, ListensOnIpV6) {
  const auto listener = Listener::open(url("tcp://[::1]:0"));
  if (!listener) GTEST_SKIP() << listener.error().sentence;
  EXPECT_NE((*listener)->url().port, 0);
}

TEST(Listener, ABusyPortIsNamedWithItsOwner) {
  const auto first = Listener::open(url("tcp://127.0.0.1:0"));
  ASSERT_TRUE(first);
  const auto second = Listener::open((*first)->url());
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().sentence,
              AllOf(HasSubstr((*first)->url().text()), HasSubstr("in use by"),
                    HasSubstr("(process " + std::to_string(::getpid()) + ")"), HasSubstr("another port")));
}

TEST(Listener, APortWithALingeringConnectionCanBeBoundAgain) {
  auto first = Listener::open(url("tcp://127.0.0.1:0"));
  ASSERT_TRUE(first);
  const ListenUrl bound = (*first)->url();
  const int client = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(bound.port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  ASSERT_EQ(::connect(client, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  const int server = ::accept((*first)->descriptor(), nullptr, nullptr);
  ASSERT_GE(server, 0);
  ::close(server);  // the hub's side closes first, so its port is the one that lingers
  *first = nullptr;
  EXPECT_TRUE(Listener::open(bound));
  ::close(client);
}

TEST(Listener, AnAddressThatIsNotOursIsExplained) {
  const auto listener = Listener::open(url("tcp://192.0.2.1:0"));
  ASSERT_FALSE(listener);
  EXPECT_THAT(listener.error().sentence, HasSubstr("no such address"));
}

TEST(Listener, RemovesItsSocketFileAtTheEnd) {
  const TestFolder folder;
  {
    const auto listener = Listener::open(url("unix:" + folder.path("s")));
    ASSERT_TRUE(listener);
    EXPECT_TRUE(fs::is_socket(folder.path("s")));
  }
  EXPECT_FALSE(fs::exists(folder.path("s")));
}

TEST(Listener, LeavesASocketFileThatSomebodyElsePutThere) {
  const TestFolder folder;
  auto first = Listener::open(url("unix:" + folder.path("s")));
  ASSERT_TRUE(first);
  fs::rename(folder.path("s"), folder.path("aside"));
  const auto second = Listener::open(url("unix:" + folder.path("s")));
  ASSERT_TRUE(second);
  *first = nullptr;
  EXPECT_TRUE(fs::is_socket(folder.path("s")));
}

TEST(Listener, ReplacesASocketFileThatNobodyAnswersOn) {
  const TestFolder folder;
  const int dead = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, folder.path("s").c_str(), sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(dead, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  ::close(dead);  // as after kill -9: the file stays
  ASSERT_TRUE(fs::is_socket(folder.path("s")));
  EXPECT_TRUE(Listener::open(url("unix:" + folder.path("s"))));
}

TEST(Listener, DoesNotTakeASocketFileFromALiveHub) {
  const TestFolder folder;
  const auto first = Listener::open(url("unix:" + folder.path("s")));
  ASSERT_TRUE(first);
  const auto second = Listener::open(url("unix:" + folder.path("s")));
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().sentence, HasSubstr("(process " + std::to_string(::getpid()) + ")"));
  EXPECT_TRUE(fs::is_socket(folder.path("s")));
}

TEST(Listener, DoesNotTouchAFileThatIsNoSocket) {
  const TestFolder folder;
  std::ofstream(folder.path("s")) << "precious";
  const auto listener = Listener::open(url("unix:" + folder.path("s")));
  ASSERT_FALSE(listener);
  EXPECT_THAT(listener.error().sentence, HasSubstr("no socket"));
  EXPECT_EQ(fs::file_size(folder.path("s")), 8u);
}

TEST(Listener, AMissingFolderIsNamed) {
  const TestFolder folder;
  const auto listener = Listener::open(url("unix:" + folder.path("none/s")));
  ASSERT_FALSE(listener);
  EXPECT_THAT(listener.error().sentence, AllOf(HasSubstr(folder.path("none")), HasSubstr("does not exist")));
}

}  // namespace
}  // namespace gimnet::hub
