#include "net/dial.hpp"

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <random>
#include <string>
#include <thread>

#include "base/descriptor.hpp"
#include "tests/net/support/link_frames.hpp"

namespace gimnet::net {
namespace {

/// A socket that listens on a free port, and takes one connection.
class Door {
 public:
  Door() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(socket_.get(), reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(socket_.get(), 1), 0);
    EXPECT_EQ(::getsockname(socket_.get(), reinterpret_cast<sockaddr*>(&address), &size), 0);
    address_.host = "127.0.0.1";
    address_.port = ntohs(address.sin_port);
  }
  [[nodiscard]] const Address& address() const { return address_; }
  [[nodiscard]] int accept() const { return ::accept4(socket_.get(), nullptr, nullptr, 0); }

 private:
  Descriptor socket_;
  Address address_;
};

Deadline patience() { return steady_now_ns() + 20'000 * kNsPerMs; }

/// Dials a hub that answers HELLO with these bytes and closes.
Result<Welcomed, NetError> dial_hub_that_says(std::vector<std::byte> answer) {
  const Door door;
  const WakeSignal cancel;
  std::thread hub([&] {
    const Descriptor far(door.accept());
    std::array<std::byte, 1024> hello;
    EXPECT_GT(::recv(far.get(), hello.data(), hello.size(), 0), 0);
    EXPECT_EQ(::send(far.get(), answer.data(), answer.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(answer.size()));
  });
  auto welcomed = dial_hub(door.address(), {}, proto::Hello{}, patience(), cancel);
  hub.join();
  return welcomed;
}

TEST(Dial, ConnectsToWhoListens) {
  const Door door;
  const WakeSignal cancel;
  const auto stream = dial(door.address(), {}, patience(), cancel);
  ASSERT_TRUE(stream);
  const Descriptor far(door.accept());
  ASSERT_EQ(::send(far.get(), "x", 1, 0), 1);
  EXPECT_TRUE(wait_for(stream->get(), {.read = true}, cancel, patience()).readable);
}

TEST(Dial, TellsThatNobodyListens) {
  Address address;
  {
    const Door door;
    address = door.address();
  }
  const WakeSignal cancel;
  const auto refused = dial(address, {}, patience(), cancel);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::no_peer);
  EXPECT_TRUE(refused.error().nobody_listens);
  EXPECT_TRUE(refused.error().sentence.ends_with("; is the hub running there?"));
  const auto nothing = dial(*parse_address("unix:/nonexistent/socket"), {}, patience(), cancel);
  ASSERT_FALSE(nothing);
  EXPECT_TRUE(nothing.error().nobody_listens);
}

TEST(Dial, TellsThatAPathIsAFolder) {
  const WakeSignal cancel;
  const auto refused = dial(*parse_address("unix:/tmp/"), {}, patience(), cancel);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::bad_address);
  EXPECT_TRUE(refused.error().sentence.ends_with("as in unix:/tmp/tcphub.sock"));
}

TEST(DialHub, GivesTheWelcomeAndLeavesTheBytesBehindIt) {
  proto::Welcome welcome;
  welcome.node = NodeId{17};
  welcome.name = "robot";
  std::vector<std::byte> answer = opening_and(welcome);
  answer.push_back(std::byte{7});
  const auto welcomed = dial_hub_that_says(answer);
  ASSERT_TRUE(welcomed);
  EXPECT_EQ(welcomed->welcome, welcome);
  std::byte left{};
  ASSERT_EQ(welcomed->stream->receive({&left, 1}).bytes, 1u);
  EXPECT_EQ(left, std::byte{7});
}

TEST(DialHub, GivesTheReasonOfAHubThatRefuses) {
  const auto refused =
      dial_hub_that_says(opening_and(proto::Goodbye{proto::GoodbyeCode::hub_full, "come later"}));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::refused);
  EXPECT_EQ(refused.error().goodbye, proto::GoodbyeCode::hub_full);
  EXPECT_TRUE(refused.error().sentence.ends_with(" refused: come later"));
}

TEST(DialHub, TellsAPeerThatIsNoHubFromOneThatLeaves) {
  const std::string_view http = "HTTP/1.1 400 Bad Request";
  const auto bytes = std::as_bytes(std::span(http));
  EXPECT_EQ(dial_hub_that_says({bytes.begin(), bytes.end()}).error().fault, Fault::protocol);
  EXPECT_EQ(dial_hub_that_says({}).error().fault, Fault::no_peer);
}

/// Dials a hub through a proxy that answers CONNECT so and then is the hub, which answers HELLO
/// so. `asked`: the bytes of CONNECT.
Result<Welcomed, NetError> dial_through(const std::string& tunnel, std::vector<std::byte> answer,
                                        std::string& asked) {
  const Door door;
  const WakeSignal cancel;
  std::thread proxy([&] {
    const Descriptor far(door.accept());
    char byte = 0;
    while (!asked.ends_with("\r\n\r\n") && ::recv(far.get(), &byte, 1, 0) == 1) asked += byte;
    EXPECT_EQ(::send(far.get(), tunnel.data(), tunnel.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(tunnel.size()));
    std::array<std::byte, 1024> hello;
    if (answer.empty() || ::recv(far.get(), hello.data(), hello.size(), 0) <= 0) return;
    EXPECT_EQ(hello[0], proto::kOpening[0]);
    EXPECT_EQ(::send(far.get(), answer.data(), answer.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(answer.size()));
  });
  DialOptions options;
  options.proxy = ProxyAddress{door.address().host, door.address().port, "ann", "secret"};
  auto welcomed =
      dial_hub(*parse_address("tcp://hub.lab:9"), options, proto::Hello{}, patience(), cancel);
  proxy.join();
  return welcomed;
}

TEST(DialHub, ShakesHandsThroughAProxy) {
  proto::Welcome welcome;
  welcome.node = NodeId{17};
  std::string asked;
  const auto welcomed =
      dial_through("HTTP/1.1 200 OK\r\nVia: p\r\n\r\n", opening_and(welcome), asked);
  ASSERT_TRUE(welcomed) << welcomed.error().sentence;
  EXPECT_EQ(welcomed->welcome, welcome);
  EXPECT_TRUE(asked.starts_with("CONNECT hub.lab:9 HTTP/1.1\r\n"));
}

TEST(DialHub, TellsWhatAProxyDidAndNeverItsPassword) {
  std::string asked;
  const std::vector<std::pair<std::string, std::string>> answers{
      {"", "it closed the connection without an answer"},
      {"HTTP/1.1 403 No\r\n\r\n", "it answers '403 No'"},
      {"HTTP/1.1 200 OK\r\n\r\n", "before it said WELCOME; is it a hub? (through the proxy "}};
  for (const auto& [answer, words] : answers) {
    asked.clear();
    const auto refused = dial_through(answer, {}, asked);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().fault, Fault::no_peer);
    EXPECT_FALSE(refused.error().nobody_listens);
    EXPECT_NE(refused.error().sentence.find(words), std::string::npos) << refused.error().sentence;
    EXPECT_NE(refused.error().sentence.find("through the proxy http://ann:***@127.0.0.1:"),
              std::string::npos)
        << refused.error().sentence;
    EXPECT_EQ(refused.error().sentence.find("secret"), std::string::npos);
  }
}

TEST(DialHub, LeavesAProxyThatIsNotThereOrNeverAnswers) {
  const WakeSignal cancel;
  DialOptions options;
  {
    const Door door;
    options.proxy = ProxyAddress{door.address().host, door.address().port, "", ""};
    const auto late = dial_hub(*parse_address("tcp://hub.lab:9"), options, proto::Hello{},
                               steady_now_ns() + 20 * kNsPerMs, cancel);
    EXPECT_EQ(late.error().fault, Fault::timeout);
    EXPECT_TRUE(late.error().sentence.ends_with("does not answer CONNECT; is it an HTTP proxy?"));
  }
  const auto gone =
      dial_hub(*parse_address("tcp://hub.lab:9"), options, proto::Hello{}, patience(), cancel);
  EXPECT_EQ(gone.error().fault, Fault::no_peer);
  EXPECT_FALSE(gone.error().nobody_listens) << "nothing is known of the hub";
  EXPECT_TRUE(gone.error().sentence.ends_with("; is the proxy running there?"));
}

TEST(DialHub, LeavesAtTheDeadlineOrWhenItIsCancelled) {
  const Door door;  // its backlog takes the connection, and nobody answers
  WakeSignal cancel;
  const auto late =
      dial_hub(door.address(), {}, proto::Hello{}, steady_now_ns() + 20 * kNsPerMs, cancel);
  EXPECT_EQ(late.error().fault, Fault::timeout);
  cancel.raise();
  const auto left = dial_hub(door.address(), {}, proto::Hello{}, kNever, cancel);
  EXPECT_EQ(left.error().fault, Fault::cancelled);
}

TEST(DialBackoff, BacksOffFrom50MillisecondsToASecond) {
  DialBackoff backoff;
  constexpr std::uint64_t kMs = 1'000'000;
  for (const std::uint64_t limit_ms : {50u, 100u, 200u, 400u, 800u, 1000u, 1000u}) {
    EXPECT_EQ(backoff.next_ns(limit_ms * kMs - 1), static_cast<std::int64_t>(limit_ms * kMs - 1));
  }
  backoff.reset();
  EXPECT_EQ(backoff.next_ns(50 * kMs), 0);
}

TEST(DialBackoff, BacksOffWithinBoundsHoweverOftenItFails) {
  DialBackoff backoff;
  std::mt19937_64 random{5};
  std::int64_t longest = 0;
  for (int failures = 0; failures < 1'000'000; ++failures) {
    const std::int64_t wait_ns = backoff.next_ns(random());
    ASSERT_GE(wait_ns, 0);
    ASSERT_LT(wait_ns, 1'000'000'000);
    longest = std::max(longest, wait_ns);
  }
  EXPECT_GT(longest, 990'000'000) << "it goes on waiting up to a second";
  EXPECT_EQ(backoff.next_ns(999'999'999), 999'999'999);
  EXPECT_LT(backoff.next_ns(UINT64_MAX), 1'000'000'000);
}

}  // namespace
}  // namespace gimnet::net
