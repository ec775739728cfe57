#include "hub/control/listener.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <vector>

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
  EXPECT_THAT(
      second.error().sentence,
      AllOf(HasSubstr((*first)->url().text()), HasSubstr("in use by"),
            HasSubstr("(process " + std::to_string(::getpid()) + ")"), HasSubstr("another port")));
}

TEST(Listener, AnAddressThatIsGivenTwiceIsNotBlamedOnAnotherProcess) {
  const auto twice = [](const std::string& one, const std::string& other) {
    std::vector<std::unique_ptr<Listener>> others;
    others.push_back(std::move(*Listener::open(url(one + ":0"))));
    const ListenUrl bound = others.front()->url();
    const ListenUrl again = url(other + ":" + std::to_string(bound.port));
    const auto second = Listener::open(again, others);
    EXPECT_EQ(second ? "" : second.error().sentence,
              "cannot listen on " + again.text() +
                  ": the address is given twice: this hub listens there already, as " +
                  bound.text() + "; leave one of the two out");
  };
  twice("tcp://127.0.0.1", "tcp://127.0.0.1");
  twice("tcp://127.0.0.1", "tcp://0.0.0.0");
  twice("tcp://0.0.0.0", "tcp://127.0.0.1");
  if (!Listener::open(url("tcp://[::1]:0"))) GTEST_SKIP() << "no IPv6 here";
  twice("tcp://[::1]", "tcp://[0:0:0:0:0:0:0:1]");
  twice("tcp://[::]", "tcp://[::1]");
  twice("tcp://[::1]", "tcp://[::]");
}

TEST(Listener, OtherAddressesOfOnePortAreListenedOnTogether) {
  std::vector<std::unique_ptr<Listener>> others;
  others.push_back(std::move(*Listener::open(url("tcp://127.0.0.1:0"))));
  const std::string port = std::to_string(others.front()->url().port);
  EXPECT_FALSE(others.front()->overlaps(url("tcp://127.0.0.2:" + port)));
  EXPECT_FALSE(others.front()->overlaps(url("tcp://[::]:" + port)));
  EXPECT_FALSE(others.front()->overlaps(url("tcp://127.0.0.1:0")));
  EXPECT_FALSE(others.front()->overlaps(url("unix:/127.0.0.1:" + port)));
}

TEST(Listener, ASocketFileThatIsGivenTwiceIsNotBlamedOnAnotherProcess) {
  const TestFolder folder;
  fs::create_directory_symlink(folder.path(""), folder.path("link"));
  std::vector<std::unique_ptr<Listener>> others;
  others.push_back(std::move(*Listener::open(url("unix:" + folder.path("s")))));
  for (const std::string other : {"s", "/s", "link/s"}) {
    const auto second = Listener::open(url("unix:" + folder.path(other)), others);
    ASSERT_FALSE(second) << other;
    EXPECT_THAT(second.error().sentence,
                AllOf(HasSubstr("unix:" + folder.path(other) + ": the address is given twice"),
                      HasSubstr("as unix:" + folder.path("s") + ";")));
  }
  EXPECT_TRUE(Listener::open(url("unix:" + folder.path("t")), others));
}

TEST(Listener, APlaceThatThisUserMayNotWriteToIsToldWithTheRemedy) {
  const TestFolder folder;
  const bool root = ::geteuid() == 0;
  const auto live = Listener::open(url("unix:" + folder.path("live")));
  ASSERT_TRUE(live);
  ASSERT_EQ(::chmod(folder.path("live").c_str(), root ? 0700 : 0), 0);
  ASSERT_EQ(::chmod(folder.path("").c_str(), 0555), 0);
  if (root) {  // who may write everywhere: it acts for another user
    ASSERT_EQ(::seteuid(12'345), 0);
  }
  const auto made = Listener::open(url("unix:" + folder.path("s")));
  const auto taken = Listener::open(url("unix:" + folder.path("live")));
  if (root) {
    ASSERT_EQ(::seteuid(0), 0);
  }
  ASSERT_EQ(::chmod(folder.path("").c_str(), 0700), 0);
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().sentence,
            "cannot listen on unix:" + folder.path("s") +
                ": Permission denied; run tcphub as a user that may write to " +
                fs::path(folder.path("s")).parent_path().string() + ", or choose another path");
  ASSERT_FALSE(taken);
  EXPECT_THAT(taken.error().sentence,
              HasSubstr("end the process that listens on it, remove it if none does"));
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

/// The file of another user: whether somebody listens on it is not to be found out.
TEST(Listener, LeavesASocketFileToWhichThisUserMayNotConnect) {
  const TestFolder folder;
  const bool root = ::geteuid() == 0;
  auto live = Listener::open(url("unix:" + folder.path("live")));
  ASSERT_TRUE(live);
  auto dead = Listener::open(url("unix:" + folder.path("dead-too")));
  ASSERT_TRUE(dead);
  fs::rename(folder.path("dead-too"),
             folder.path("dead"));  // a listener that ends leaves it alone there
  *dead = nullptr;
  for (const char* name : {"live", "dead"}) {
    ASSERT_EQ(::chmod(folder.path(name).c_str(), root ? 0700 : 0), 0);
  }
  ASSERT_EQ(::chmod(folder.path("").c_str(), 0777), 0);
  for (const char* name : {"live", "dead"}) {
    if (root) {  // who may connect everywhere: it acts for another user
      ASSERT_EQ(::seteuid(12'345), 0);
    }
    const auto taken = Listener::open(url("unix:" + folder.path(name)));
    if (root) {
      ASSERT_EQ(::seteuid(0), 0);
    }
    ASSERT_FALSE(taken) << name;
    EXPECT_EQ(taken.error().sentence,
              "cannot listen on unix:" + folder.path(name) +
                  ": there is a socket to which this user may not connect, as that of another "
                  "user; end the process "
                  "that listens on it, remove it if none does, or choose another path");
    EXPECT_TRUE(fs::is_socket(folder.path(name)));
  }
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

TEST(Listener, AFolderIsNoSocket) {
  const TestFolder folder;
  for (const std::string& path : {folder.path("s"), folder.path("s/")}) {
    ::mkdir(folder.path("s").c_str(), 0700);
    const auto listener = Listener::open(url("unix:" + path));
    ASSERT_FALSE(listener);
    EXPECT_EQ(listener.error().sentence, "cannot listen on unix:" + path +
                                             ": it is a folder; name a file in it, as in unix:" +
                                             folder.path("s") + "/tcphub.sock");
  }
}

TEST(Listener, AMissingFolderIsNamed) {
  const TestFolder folder;
  const auto listener = Listener::open(url("unix:" + folder.path("none/s")));
  ASSERT_FALSE(listener);
  EXPECT_THAT(listener.error().sentence,
              AllOf(HasSubstr(folder.path("none")), HasSubstr("does not exist")));
}

}  // namespace
}  // namespace gimnet::hub
