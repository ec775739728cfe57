#include "impair/fault_proxy.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>
#include <string>
#include <thread>

#include "base/clock.hpp"
#include "base/descriptor.hpp"
#include "impair/delayed_channel.hpp"

namespace gimnet::impair {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr timeval kPatience{20, 0};

sockaddr_in loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return address;
}

int with_patience(int descriptor) {
  ::setsockopt(descriptor, SOL_SOCKET, SO_RCVTIMEO, &kPatience, sizeof kPatience);
  return descriptor;
}

class FaultProxyTest : public testing::Test {
 protected:
  FaultProxyTest() : server_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address = loopback(0);
    ::bind(server_.get(), reinterpret_cast<sockaddr*>(&address), sizeof address);
    ::listen(server_.get(), 10);
    socklen_t size = sizeof address;
    ::getsockname(server_.get(), reinterpret_cast<sockaddr*>(&address), &size);
    target_ = "tcp://127.0.0.1:" + std::to_string(ntohs(address.sin_port));
    with_patience(server_.get());
  }

  void open(const Impairment& how) {
    auto opened = FaultProxy::open(*net::parse_address("tcp://127.0.0.1:0", 0),
                                   *net::parse_address(target_), how, 1);
    ASSERT_TRUE(opened) << opened.error().sentence;
    proxy_ = std::move(*opened);
  }

  void connect(const Descriptor& from) {
    const sockaddr_in address = loopback(net::parse_address(proxy_->url())->port);
    EXPECT_EQ(::connect(from.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address),
              0);
  }
  int dial() {
    Descriptor made(with_patience(::socket(AF_INET, SOCK_STREAM, 0)));
    connect(made);
    return made.release();
  }
  int accept() { return with_patience(::accept(server_.get(), nullptr, nullptr)); }

  static void say(const Descriptor& to, const std::string& text) {
    EXPECT_EQ(::send(to.get(), text.data(), text.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(text.size()));
  }
  /// `count` bytes; fewer where the connection ends.
  static std::string hear(const Descriptor& from, std::size_t count) {
    std::string text(count, '\0');
    const ssize_t got = ::recv(from.get(), text.data(), count, MSG_WAITALL);
    text.resize(got < 0 ? 0 : static_cast<std::size_t>(got));
    return text;
  }
  static bool is_reset(const Descriptor& end) {
    char byte = 0;
    return ::recv(end.get(), &byte, 1, 0) < 0 && errno == ECONNRESET;
  }

  Descriptor server_;
  std::string target_;
  std::unique_ptr<FaultProxy> proxy_;
};

TEST_F(FaultProxyTest, RelaysBothWaysAndTheEndsOfEach) {
  open({});
  const Descriptor client(dial());
  const Descriptor server(accept());
  say(client, "question");
  EXPECT_EQ(hear(server, 8), "question");
  ::shutdown(client.get(), SHUT_WR);
  EXPECT_EQ(hear(server, 1), "");
  say(server, "answer");
  EXPECT_EQ(hear(client, 6), "answer");
  ::shutdown(server.get(), SHUT_WR);
  EXPECT_EQ(hear(client, 1), "");
  for (int i = 0; proxy_->relayed().connections != 0; ++i) {
    ASSERT_LT(i, 1000);
    proxy_->go();
  }
  EXPECT_EQ(proxy_->relayed().up_bytes, 8u);
  EXPECT_EQ(proxy_->relayed().down_bytes, 6u);
}

TEST_F(FaultProxyTest, AMegabyteInPiecesArrivesWhole) {
  open({.delay_ns = kMs, .jitter_ns = kMs, .split = 1000});
  const Descriptor client(dial());
  const Descriptor server(accept());
  std::string sent(1'000'000, '\0');
  for (std::size_t i = 0; i < sent.size(); ++i) sent[i] = static_cast<char>(i * i >> 7);
  std::thread sender([&] { say(client, sent); });
  EXPECT_EQ(hear(server, sent.size()), sent);
  sender.join();
}

TEST_F(FaultProxyTest, DelaysEachWay) {
  open({.delay_ns = 30 * kMs});
  const Descriptor client(dial());
  const Descriptor server(accept());
  const std::int64_t begin = steady_now_ns();
  say(client, "x");
  EXPECT_EQ(hear(server, 1), "x");
  say(server, "y");
  EXPECT_EQ(hear(client, 1), "y");
  EXPECT_GE(steady_now_ns() - begin, 60 * kMs);
}

TEST_F(FaultProxyTest, AStallHoldsOneWayUntilItIsLifted) {
  open({});
  const Descriptor client(dial());
  const Descriptor server(accept());
  proxy_->stall(RelayDirection::up, DelayedChannel::kNever);
  say(client, "held");
  say(server, "free");
  EXPECT_EQ(hear(client, 4), "free");
  std::string early(4, '\0');
  EXPECT_LT(::recv(server.get(), early.data(), 4, MSG_DONTWAIT), 0);
  proxy_->go();
  EXPECT_EQ(hear(server, 4), "held");
}

TEST_F(FaultProxyTest, AnEndDuringAStallIsToldBehindIt) {
  open({});
  const Descriptor client(dial());
  const Descriptor server(accept());
  proxy_->stall(RelayDirection::both, 50 * kMs);
  const std::int64_t begin = steady_now_ns();
  ::shutdown(client.get(), SHUT_WR);
  EXPECT_EQ(hear(server, 1), "");
  EXPECT_GE(steady_now_ns() - begin, 40 * kMs);
}

TEST_F(FaultProxyTest, ACutResetsBothEnds) {
  open({});
  const Descriptor client(dial());
  const Descriptor server(accept());
  say(client, "x");
  EXPECT_EQ(hear(server, 1), "x");
  proxy_->cut();
  EXPECT_TRUE(is_reset(client));
  EXPECT_TRUE(is_reset(server));
  const Descriptor again(dial());
  const Descriptor served(accept());
  say(again, "y");
  EXPECT_EQ(hear(served, 1), "y");
  EXPECT_EQ(proxy_->relayed().cut, 1u);
}

TEST_F(FaultProxyTest, DrawnCutsComeByThemselves) {
  open({.cut_every_ns = 5 * kMs});
  for (int i = 0; i < 3; ++i) {
    const Descriptor client(dial());
    EXPECT_TRUE(is_reset(client));
  }
}

TEST_F(FaultProxyTest, RefusesWhileItIsTold) {
  open({});
  proxy_->refuse(true);
  {
    const Descriptor client(dial());
    EXPECT_TRUE(is_reset(client));
  }
  proxy_->refuse(false);
  const Descriptor client(dial());
  const Descriptor server(accept());
  say(client, "x");
  EXPECT_EQ(hear(server, 1), "x");
  EXPECT_EQ(proxy_->relayed().refused, 1u);
}

std::int64_t processor_ns() {
  timespec used{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  return used.tv_sec * 1'000'000'000 + used.tv_nsec;
}

TEST_F(FaultProxyTest, WithoutADescriptorItRestsAndThenGoesOn) {
  open({});
  const Descriptor client(::socket(AF_INET, SOCK_STREAM, 0));
  rlimit limits{};
  ::getrlimit(RLIMIT_NOFILE, &limits);
  rlimit none = limits;
  none.rlim_cur = static_cast<rlim_t>(Descriptor(::dup(client.get())).get());
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  connect(client);
  const std::int64_t before = processor_ns();
  pollfd answer{client.get(), POLLIN, 0};
  EXPECT_EQ(::poll(&answer, 1, 300), 0);
  EXPECT_LT(processor_ns() - before, 20 * kMs);
  ::setrlimit(RLIMIT_NOFILE, &limits);
  const Descriptor server(accept());
  say(client, "x");
  EXPECT_EQ(hear(server, 1), "x");
}

TEST_F(FaultProxyTest, ATargetThatIsNotThereCostsOnlyTheConnection) {
  open({});
  ::close(server_.release());
  const Descriptor client(dial());
  EXPECT_TRUE(is_reset(client));
}

TEST_F(FaultProxyTest, AResetAtOneEndReachesTheOther) {
  open({.delay_ns = kMs});
  Descriptor client(dial());
  const Descriptor server(accept());
  say(client, "x");
  EXPECT_EQ(hear(server, 1), "x");
  const linger at_once{1, 0};
  ::setsockopt(client.get(), SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
  ::close(client.release());
  EXPECT_TRUE(is_reset(server));
}

TEST(FaultProxy, NamesTheAddressThatCannotBe) {
  const auto opened = FaultProxy::open(*net::parse_address("unix:/nonexistent/x"),
                                       *net::parse_address("tcp://127.0.0.1:1"), {}, 1);
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().sentence,
            "cannot listen on unix:/nonexistent/x: No such file or directory");
}

}  // namespace
}  // namespace gimnet::impair
