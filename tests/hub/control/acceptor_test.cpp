#include "hub/control/acceptor.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>

#include "proto/control/link.hpp"
#include "proto/frame/frame_header.hpp"
#include "tests/hub/control/support/folder.hpp"

namespace gimnet::hub {
namespace {

using ::testing::StartsWith;

class AcceptorTest : public ::testing::Test {
 protected:
  ~AcceptorTest() override {
    for (const int descriptor : open_) ::close(descriptor);
  }
  std::unique_ptr<Acceptor> acceptor(const std::string& url) {
    auto listener = Listener::open(*parse_listen_url(url));
    EXPECT_TRUE(listener);
    return std::make_unique<Acceptor>(std::move(*listener), limits_, refusals_);
  }
  int socket(int family) {
    open_.push_back(::socket(family, SOCK_STREAM | SOCK_CLOEXEC, 0));
    return open_.back();
  }
  static void dial(int descriptor, const ListenUrl& url) {
    if (url.scheme == ListenUrl::Scheme::unix_socket) {
      sockaddr_un address{};
      address.sun_family = AF_UNIX;
      std::strncpy(address.sun_path, url.path.c_str(), sizeof address.sun_path - 1);
      ASSERT_EQ(::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
      return;
    }
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(url.port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    ASSERT_EQ(::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  Acceptor::After accept(Acceptor& acceptor) {
    return acceptor.accept_some([this](Stranger stranger) { strangers_.push_back(std::move(stranger)); });
  }

  const Limits limits_;
  RefusalCounters refusals_;
  TestFolder folder_;
  std::vector<int> open_;
  std::vector<Stranger> strangers_;
};

TEST_F(AcceptorTest, KnowsTcpPeersByAddress) {
  const auto door = acceptor("tcp://127.0.0.1:0");
  dial(socket(AF_INET), door->listener().url());
  EXPECT_EQ(accept(*door), Acceptor::After::wait);
  ASSERT_EQ(strangers_.size(), 1u);
  EXPECT_EQ(strangers_[0].peer.transport, "tcp");
  EXPECT_THAT(strangers_[0].peer.address, StartsWith("127.0.0.1:"));
  EXPECT_FALSE(strangers_[0].may_administer);
}

TEST_F(AcceptorTest, KnowsUnixPeersByTheKernelsWord) {
  const auto door = acceptor("unix:" + folder_.path("s"));
  dial(socket(AF_UNIX), door->listener().url());
  accept(*door);
  ASSERT_EQ(strangers_.size(), 1u);
  EXPECT_EQ(strangers_[0].peer.transport, "unix");
  EXPECT_EQ(strangers_[0].peer.address, "pid " + std::to_string(::getpid()) + " uid " + std::to_string(::getuid()));
  EXPECT_TRUE(strangers_[0].may_administer);
}

TEST_F(AcceptorTest, TakesABatchAndComesBackForTheRest) {
  const auto door = acceptor("unix:" + folder_.path("s"));
  for (int i = 0; i < 70; ++i) dial(socket(AF_UNIX), door->listener().url());
  accept(*door);
  EXPECT_EQ(strangers_.size(), 64u);
  accept(*door);
  EXPECT_EQ(strangers_.size(), 70u);
}

TEST_F(AcceptorTest, OutOfDescriptorsItTellsThePeerAndTakesTheNextOneLater) {
  const auto door = acceptor("unix:" + folder_.path("s"));
  const int client = socket(AF_UNIX);
  const int later = socket(AF_UNIX);
  dial(client, door->listener().url());
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  const int highest = ::dup(client);
  open_.push_back(highest);
  rlimit none = before;
  none.rlim_cur = static_cast<rlim_t>(highest) + 1;
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  std::vector<int> fill;  // whatever is free below the limit
  for (int each = ::dup(client); each >= 0; each = ::dup(client)) fill.push_back(each);
  EXPECT_EQ(accept(*door), Acceptor::After::wait);
  EXPECT_TRUE(strangers_.empty());
  EXPECT_EQ(refusals_.no_descriptor.value(), 1u);
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &before), 0);
  for (const int each : fill) ::close(each);
  std::byte answer[512];
  const ssize_t size = ::recv(client, answer, sizeof answer, 0);
  ASSERT_GT(size, static_cast<ssize_t>(proto::kOpeningSize + proto::kHeaderSize));
  const auto goodbye = proto::decode<proto::Goodbye>(
      std::span{answer, static_cast<std::size_t>(size)}.subspan(proto::kOpeningSize + proto::kHeaderSize));
  ASSERT_TRUE(goodbye);
  EXPECT_EQ(goodbye->code, proto::GoodbyeCode::no_memory);
  EXPECT_EQ(::recv(client, answer, sizeof answer, 0), 0);
  dial(later, door->listener().url());
  accept(*door);
  EXPECT_EQ(strangers_.size(), 1u);
}

}  // namespace
}  // namespace gimnet::hub
