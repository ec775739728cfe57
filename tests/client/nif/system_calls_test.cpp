#include "tests/support/system_calls.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <string>
#include <thread>
#include <vector>

#include "client/nif/outbound.hpp"
#include "net/socket_stream.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

// The price of sending in system calls, as the kernel counts them: one for a small message by
// itself, one for many that had to wait. None of this depends on how fast anything is.

namespace gimnet::nif::test {
namespace {

using gimnet::test::system_calls_of;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using Calls = std::vector<int>;

/// GTEST_SKIP() leaves the function that it stands in.
#define GIMNET_COUNT_OR_SKIP(calls, before, counted)                                       \
  const std::optional<Calls> calls##_told = system_calls_of(before, counted);              \
  if (!(calls##_told)) GTEST_SKIP() << "this kernel does not tell system calls (seccomp)"; \
  const Calls& calls = *(calls##_told)

constexpr std::string_view kSmall = "sixteen bytes!!!";

/// The sending half alone, with the other end of its socket: nobody else sends or wakes.
class SystemCalls : public ::testing::Test {
 protected:
  SystemCalls() {
    std::array<int, 2> ends{};
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, ends.data()), 0);
    socket_ = std::make_unique<net::SocketStream>(ends[0], net::SocketStream::Family::unix_socket);
    peer_ = std::make_unique<net::SocketStream>(ends[1], net::SocketStream::Family::unix_socket);
    SessionTerms session;
    session.id = kOwnId;
    session.frame_bytes_max = 65'536;
    EXPECT_TRUE(outbound_.attach(*socket_, session));
  }
  ~SystemCalls() override { outbound_.detach(false); }

  void send(std::uint8_t flags = 0, std::uint8_t lane = NIF_NORMAL) {
    const nif_bytes part = {kSmall.data(), kSmall.size()};
    nif_outgoing message = NIF_OUTGOING_INIT;
    message.to = kPeerId;
    message.lane = lane;
    message.flags = flags;
    message.parts = &part;
    message.part_count = 1;
    Outgoing outgoing;
    ok_ = !outgoing.read(message) && outbound_.send(outgoing, 0) == NIF_OK && ok_;
  }
  /// One that takes memory for those that follow, and what the library's thread does where it was
  /// woken.
  void send_first() {
    send();
    outbound_.write_pending(false);
  }
  /// Until the kernel takes no more.
  void fill() {
    const std::array<std::byte, 4096> bytes{};
    while (::send(socket_->descriptor(), bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL) >
           0) {
    }
  }
  /// Takes all that came; returns how many bytes.
  std::size_t empty() {
    std::array<std::byte, 65'536> bytes;
    std::size_t all = 0;
    for (;;) {
      const net::IoResult result = peer_->receive(bytes);
      if (result.status != net::IoStatus::ok) return all;
      all += result.bytes;
    }
  }

  static constexpr std::size_t kFrame = proto::kHeaderSize + kSmall.size();
  static constexpr int kMessages = 1'000;
  net::WakeSignal wake_;
  Outbound outbound_{{}, wake_};
  std::unique_ptr<net::Stream> socket_;
  std::unique_ptr<net::Stream> peer_;
  bool ok_ = true;
};

TEST_F(SystemCalls, OneForASmallMessage) {
  GIMNET_COUNT_OR_SKIP(calls, [this] { send_first(); }, [this] { send(); });
  EXPECT_THAT(calls, ElementsAre(SYS_sendto));
  EXPECT_TRUE(ok_);
  EXPECT_EQ(empty(), 2 * kFrame);
}

TEST_F(SystemCalls, OneForManyThatAreToGoTogether) {
  const auto send_all = [this] {
    for (int i = 1; i < kMessages; ++i) send(NIF_FLAG_MORE);
    send();
  };
  GIMNET_COUNT_OR_SKIP(calls, [this] { send_first(); }, send_all);
  EXPECT_THAT(calls, ElementsAre(SYS_sendto));
  EXPECT_TRUE(ok_);
  EXPECT_EQ(empty(), (kMessages + 1) * kFrame);
}

TEST_F(SystemCalls, NoneForWhatFollowsAFullSocket) {
  const auto send_all = [this] {
    for (int i = 0; i < kMessages; ++i) send();
  };
  GIMNET_COUNT_OR_SKIP(calls, [this] { fill(); }, send_all);
  EXPECT_THAT(calls, ElementsAre(SYS_sendto, SYS_write))
      << "the try that fails, and the library's thread is told";
  EXPECT_TRUE(ok_);
  static_cast<void>(empty());
  // As the library's thread does when the kernel has room again.
  GIMNET_COUNT_OR_SKIP(written, [] {}, [this] { outbound_.write_pending(true); });
  EXPECT_THAT(written, ElementsAre(SYS_sendto)) << "for all of them";
  EXPECT_EQ(empty(), kMessages * kFrame);
}

TEST_F(SystemCalls, OneForWhatWaitsInSeveralLanes) {
  constexpr int kEach = 20;
  fill();
  for (int i = 0; i < kEach; ++i) {
    send(0, NIF_NORMAL);
    send(0, NIF_BULK);
    send(0, NIF_REAL_TIME);
  }
  static_cast<void>(empty());
  GIMNET_COUNT_OR_SKIP(calls, [] {}, [this] { outbound_.write_pending(true); });
  EXPECT_THAT(calls, ElementsAre(SYS_sendmsg));
  EXPECT_TRUE(ok_);
  EXPECT_EQ(empty(), 3 * kEach * kFrame);
}

/// The whole library, as a program calls it.
TEST(SystemCallsOfNif, OneForASmallMessage) {
  FakeHub hub;
  proto::Welcome welcome = make_welcome();
  welcome.keep_alive_ms = 3'600'000;  // nothing is sent but what is sent here
  welcome.silent_ms = 3 * welcome.keep_alive_ms;
  Connected connected = connect_to(hub, default_options(), welcome);
  nif_node* const node = connected.node.get();
  nif_status status = NIF_OK;
  const auto send_one = [&] {
    const nif_bytes part = {kSmall.data(), kSmall.size()};
    nif_outgoing message = NIF_OUTGOING_INIT;
    message.to = kPeerId;
    message.parts = &part;
    message.part_count = 1;
    if (status == NIF_OK) status = nif_send(node, &message, NIF_FOREVER);
  };
  GIMNET_COUNT_OR_SKIP(all, send_one, send_one);
  EXPECT_EQ(status, NIF_OK) << nif_error_text();
  // The library's thread may look whether there is something to do at this very moment, and this
  // one wait for its lock.
  Calls calls = all;
  std::erase(calls, SYS_futex);
  EXPECT_THAT(calls, ElementsAre(SYS_sendto));
  for (int i = 0; i < 2; ++i) EXPECT_EQ(connected.hub.next_message()->payload(), kSmall);
  EXPECT_EQ(counters_of(node).write_calls, 2u);
}

/// That the counting sees what there is to see.
TEST(SystemCallsOfNif, TellsEachCallOnce) {
  const auto call = [] {
    static_cast<void>(::getppid());
    net::WakeSignal wake;
    wake.raise();
  };
  GIMNET_COUNT_OR_SKIP(calls, [] { static_cast<void>(::getppid()); }, call);
  EXPECT_THAT(calls, ElementsAre(SYS_getppid, SYS_eventfd2, SYS_write, SYS_close));
  GIMNET_COUNT_OR_SKIP(none, call, [] {});
  EXPECT_THAT(none, IsEmpty());
}

}  // namespace
}  // namespace gimnet::nif::test
