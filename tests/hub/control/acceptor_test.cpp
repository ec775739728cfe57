#include "hub/control/acceptor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <optional>

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
    return std::make_unique<Acceptor>(
        std::move(*listener), limits_, refusals_, reserve_,
        [this](const Stranger& newcomer) { return make_room_(newcomer); });
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
      ASSERT_EQ(::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address),
                0);
      return;
    }
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(url.port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    ASSERT_EQ(::connect(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address),
              0);
  }
  Acceptor::After accept(Acceptor& acceptor) {
    return acceptor.accept_some(
        [this](Stranger stranger) { strangers_.push_back(std::move(stranger)); });
  }

  static Limits limits() {
    Limits result;
    result.administrators = 2;
    return result;
  }

  const Limits limits_ = limits();
  RefusalCounters refusals_;
  DescriptorReserve reserve_{limits_};
  Acceptor::MakeRoom make_room_ = [](const Stranger&) { return Acceptor::Room::none; };
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
  EXPECT_EQ(strangers_[0].identity, Identity::open());
  EXPECT_FALSE(strangers_[0].rights.administer);
}

TEST_F(AcceptorTest, KnowsUnixPeersByTheKernelsWord) {
  const auto door = acceptor("unix:" + folder_.path("s"));
  dial(socket(AF_UNIX), door->listener().url());
  accept(*door);
  ASSERT_EQ(strangers_.size(), 1u);
  EXPECT_EQ(strangers_[0].peer.transport, "unix");
  EXPECT_EQ(strangers_[0].peer.address,
            "pid " + std::to_string(::getpid()) + " uid " + std::to_string(::getuid()));
  EXPECT_EQ(strangers_[0].identity, Identity::of_user(::getuid()));
  EXPECT_TRUE(strangers_[0].rights.administer);
}

TEST_F(AcceptorTest, TakesABatchAndComesBackForTheRest) {
  const auto door = acceptor("unix:" + folder_.path("s"));
  for (int i = 0; i < 70; ++i) dial(socket(AF_UNIX), door->listener().url());
  accept(*door);
  EXPECT_EQ(strangers_.size(), 64u);
  accept(*door);
  EXPECT_EQ(strangers_.size(), 70u);
}

/// While it lives this process has no free descriptor.
class NoDescriptors {
 public:
  NoDescriptors() {
    EXPECT_EQ(::getrlimit(RLIMIT_NOFILE, &before_), 0);
    const int highest = ::dup(0);
    fill_.push_back(highest);
    rlimit none = before_;
    none.rlim_cur = static_cast<rlim_t>(highest) + 1;
    EXPECT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
    for (int each = ::dup(0); each >= 0; each = ::dup(0)) fill_.push_back(each);
  }
  ~NoDescriptors() {
    EXPECT_EQ(::setrlimit(RLIMIT_NOFILE, &before_), 0);
    while (!fill_.empty()) free_one();
  }
  NoDescriptors(const NoDescriptors&) = delete;
  NoDescriptors& operator=(const NoDescriptors&) = delete;

  void free_one() {
    ::close(fill_.back());
    fill_.pop_back();
  }

 private:
  rlimit before_{};
  std::vector<int> fill_;
};

/// The GOODBYE that came, and then the end.
std::optional<proto::Goodbye> goodbye_and_end(int client) {
  std::byte answer[512];
  const ssize_t size = ::recv(client, answer, sizeof answer, 0);
  constexpr std::size_t kBefore = proto::kOpeningSize + proto::kHeaderSize;
  std::byte nothing{};
  if (size < static_cast<ssize_t>(kBefore) || ::recv(client, &nothing, 1, 0) != 0)
    return std::nullopt;
  const auto goodbye = proto::decode<proto::Goodbye>(
      std::span{answer, static_cast<std::size_t>(size)}.subspan(kBefore));
  return goodbye ? std::optional{*goodbye} : std::nullopt;
}

TEST_F(AcceptorTest, OutOfDescriptorsItTellsThePeerAndTakesTheNextOneLater) {
  const auto door = acceptor("tcp://127.0.0.1:0");
  const int client = socket(AF_INET);
  const int later = socket(AF_INET);
  dial(client, door->listener().url());
  {
    const NoDescriptors none;
    EXPECT_EQ(accept(*door), Acceptor::After::wait);
  }
  EXPECT_TRUE(strangers_.empty());
  EXPECT_EQ(refusals_.no_descriptor.value(), 1u);
  const auto goodbye = goodbye_and_end(client);
  ASSERT_TRUE(goodbye);
  EXPECT_EQ(goodbye->code, proto::GoodbyeCode::no_memory);
  dial(later, door->listener().url());
  accept(*door);
  EXPECT_EQ(strangers_.size(), 1u);
}

TEST_F(AcceptorTest, OutOfDescriptorsAdministratorsAreTakenOnTheReserveUntilItIsEmpty) {
  const auto door = acceptor("unix:" + folder_.path("s"));
  const int clients[] = {socket(AF_UNIX), socket(AF_UNIX), socket(AF_UNIX)};
  for (const int client : clients) dial(client, door->listener().url());
  {
    const NoDescriptors none;
    accept(*door);
  }
  ASSERT_EQ(strangers_.size(), 2u);
  for (const Stranger& each : strangers_) EXPECT_TRUE(each.on_reserve);
  EXPECT_EQ(reserve_.kept(), 0u);
  EXPECT_EQ(refusals_.no_descriptor.value(), 1u);
  EXPECT_TRUE(goodbye_and_end(clients[2]));
  accept(*door);
  EXPECT_EQ(reserve_.kept(), 2u) << "taken back";
  strangers_.clear();
  dial(socket(AF_UNIX), door->listener().url());
  accept(*door);
  ASSERT_EQ(strangers_.size(), 1u);
  EXPECT_FALSE(strangers_[0].on_reserve);
}

TEST_F(AcceptorTest, OutOfDescriptorsOthersMakeRoom) {
  const auto door = acceptor("tcp://127.0.0.1:0");
  dial(socket(AF_INET), door->listener().url());
  {
    NoDescriptors none;
    make_room_ = [&](const Stranger&) {
      none.free_one();
      return Acceptor::Room::ordinary;
    };
    accept(*door);
    ASSERT_EQ(strangers_.size(), 1u);
    EXPECT_FALSE(strangers_[0].on_reserve);
    make_room_ = [](const Stranger&) { return Acceptor::Room::none; };
  }
  EXPECT_EQ(refusals_.no_descriptor.value(), 0u);
  EXPECT_EQ(reserve_.kept(), 2u);
}

TEST_F(AcceptorTest, WhoGetsAnAdministratorsDescriptorIsOnTheReserve) {
  const auto door = acceptor("unix:" + folder_.path("s"));
  dial(socket(AF_UNIX), door->listener().url());
  {
    NoDescriptors none;
    make_room_ = [&](const Stranger& newcomer) {
      EXPECT_TRUE(newcomer.rights.administer);
      none.free_one();
      return Acceptor::Room::reserved;
    };
    accept(*door);
  }
  ASSERT_EQ(strangers_.size(), 1u);
  EXPECT_TRUE(strangers_[0].on_reserve);
}

}  // namespace
}  // namespace gimnet::hub
