#include "net/wait.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>

#include "tests/net/support/connected_sockets.hpp"

namespace gimnet::net {
namespace {

/// A Unix socket that says that it keeps bytes of its own.
class KeepingStream final : public Stream {
 public:
  explicit KeepingStream(int descriptor) : socket_(descriptor, SocketStream::Family::unix_socket) {}
  [[nodiscard]] IoResult receive(std::span<std::byte> into) override {
    return socket_.receive(into);
  }
  [[nodiscard]] IoResult send(std::span<const iovec> pieces) override {
    return socket_.send(pieces);
  }
  void shut_down() override {}
  [[nodiscard]] std::size_t pending_in() const override { return kept; }
  [[nodiscard]] std::uint64_t unsent_bytes() const override { return 0; }
  void limit_unsent(std::uint32_t) override {}
  void limit_unacknowledged(std::uint32_t) override {}
  [[nodiscard]] int descriptor() const override { return socket_.descriptor(); }

  std::size_t kept = 0;

 private:
  SocketStream socket_;
};

Deadline patience() { return steady_now_ns() + 20'000 * kNsPerMs; }

TEST(WaitFor, EndsWhenTheSignalIsRaised) {
  WakeSignal wake;
  EXPECT_FALSE(wait_for(nullptr, {}, wake, 0).woken);
  wake.raise();
  EXPECT_TRUE(wait_for(nullptr, {}, wake, patience()).woken);
  wake.clear();
  EXPECT_FALSE(wait_for(nullptr, {}, wake, 0).woken);
}

TEST(WaitFor, TellsOnlyTheReadinessThatIsAskedFor) {
  const ConnectedSockets ends = connect_by_unix();
  const SocketStream stream(ends.near, SocketStream::Family::unix_socket);
  const SocketStream far(ends.far, SocketStream::Family::unix_socket);
  const WakeSignal wake;
  EXPECT_FALSE(wait_for(&stream, {.read = true}, wake, 0).readable);
  EXPECT_TRUE(wait_for(&stream, {.write = true}, wake, patience()).writable);
  ASSERT_EQ(::send(far.descriptor(), "x", 1, 0), 1);
  const Readiness ready = wait_for(&stream, {.read = true}, wake, patience());
  EXPECT_TRUE(ready.readable);
  EXPECT_FALSE(ready.writable);
  EXPECT_FALSE(wait_for(&stream, {.write = true}, wake, 0).readable);
}

TEST(WaitFor, DoesNotWaitForBytesThatTheStreamKeeps) {
  const ConnectedSockets ends = connect_by_unix();
  KeepingStream stream(ends.near);
  const SocketStream far(ends.far, SocketStream::Family::unix_socket);
  const WakeSignal wake;
  stream.kept = 1;
  EXPECT_TRUE(wait_for(&stream, {.read = true}, wake, kNever).readable);
  EXPECT_FALSE(wait_for(&stream, {.write = true}, wake, patience()).readable) << "nobody reads";
  stream.kept = 0;
  EXPECT_FALSE(wait_for(&stream, {.read = true}, wake, 0).readable);
}

TEST(WaitForEither, TellsWhichSignalWasRaised) {
  WakeSignal one;
  WakeSignal other;
  other.raise();
  const Raised raised = wait_for_either(one, other, patience());
  EXPECT_FALSE(raised.one);
  EXPECT_TRUE(raised.other);
  one.raise();
  EXPECT_TRUE(wait_for_either(one, other, patience()).one);
}

}  // namespace
}  // namespace gimnet::net
