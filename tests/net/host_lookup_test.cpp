#include "net/host_lookup.hpp"

#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <condition_variable>
#include <cstring>
#include <memory>
#include <mutex>
#include <thread>

namespace gimnet::net {
namespace {

Address address_of(const char* url) { return *parse_address(url); }

HostAddresses nothing_found(const std::string&, std::uint16_t) { return {"nobody knows it", {}}; }

/// A name server that does not answer until it is told to. Outlives the test, as the searches may
/// that wait for it.
class SilentServer {
 public:
  SilentServer() : state_(std::make_shared<State>()) {}
  ~SilentServer() { answer(); }
  [[nodiscard]] HostLookup lookup() const {
    return [state = state_](const std::string&, std::uint16_t) {
      std::unique_lock lock(state->mutex);
      ++state->asked;
      state->changed.notify_all();
      state->changed.wait(lock, [&] { return state->answers; });
      return HostAddresses{"too late", {}};
    };
  }
  void wait_until_asked(int times) const {
    std::unique_lock lock(state_->mutex);
    state_->changed.wait(lock, [&] { return state_->asked >= times; });
  }
  void answer() const {
    const std::lock_guard lock(state_->mutex);
    state_->answers = true;
    state_->changed.notify_all();
  }

 private:
  struct State {
    std::mutex mutex;
    std::condition_variable changed;
    int asked = 0;
    bool answers = false;
  };
  std::shared_ptr<State> state_;
};

TEST(HostLookup, ReadsNumbersWithoutAskingAnybody) {
  const WakeSignal cancel;
  const auto found = find_addresses(address_of("tcp://127.0.0.1:7450"), 0, cancel);
  ASSERT_TRUE(found);
  ASSERT_EQ(found->size(), 1u);
  sockaddr_in address{};
  ASSERT_EQ(found->front().size(), sizeof address);
  std::memcpy(&address, found->front().data(), sizeof address);
  EXPECT_EQ(address.sin_family, AF_INET);
  EXPECT_EQ(ntohs(address.sin_port), 7450);
  EXPECT_EQ(ntohl(address.sin_addr.s_addr), INADDR_LOOPBACK);
  EXPECT_TRUE(find_addresses(address_of("tcp://[::1]:1"), 0, cancel));
}

TEST(HostLookup, ThePathOfASocketIsItsOneAddress) {
  const WakeSignal cancel;
  const std::string path(kSocketPathMax, 'x');
  const auto found = find_addresses(address_of(("unix:" + path).c_str()), 0, cancel);
  ASSERT_TRUE(found);
  ASSERT_EQ(found->size(), 1u);
  sockaddr_un address{};
  ASSERT_EQ(found->front().size(), sizeof address);
  std::memcpy(&address, found->front().data(), sizeof address);
  EXPECT_EQ(address.sun_family, AF_UNIX);
  EXPECT_EQ(address.sun_path, path);
}

TEST(HostLookup, GivesAllThatIsFound) {
  const WakeSignal cancel;
  const HostAddress one(sizeof(sockaddr_in), std::byte{1});
  const HostAddress two(sizeof(sockaddr_in6), std::byte{2});
  std::string asked;
  const auto found = find_addresses(address_of("tcp://robot.local:5"), kNever, cancel,
                                    [&](const std::string& host, std::uint16_t port) {
                                      asked = host + " " + std::to_string(port);
                                      return HostAddresses{"", {one, two}};
                                    });
  ASSERT_TRUE(found);
  EXPECT_EQ(*found, (std::vector{one, two}));
  EXPECT_EQ(asked, "robot.local 5");
}

TEST(HostLookup, SaysWhyThereIsNone) {
  const WakeSignal cancel;
  const auto found =
      find_addresses(address_of("tcp://robot.local:5"), kNever, cancel, nothing_found);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, Fault::no_host);
  EXPECT_EQ(found.error().sentence, "cannot find the host of tcp://robot.local:5: nobody knows it");
  const auto failed = find_addresses(
      address_of("tcp://robot.local:5"), kNever, cancel,
      [](const std::string&, std::uint16_t) -> HostAddresses { throw std::bad_alloc(); });
  ASSERT_FALSE(failed);
  EXPECT_NE(failed.error().sentence.find("out of memory"), std::string::npos);
}

TEST(HostLookup, LeavesAtTheDeadlineWhereNobodyAnswers) {
  const SilentServer server;
  const WakeSignal cancel;
  const auto found = find_addresses(address_of("tcp://robot.local:5"), steady_now_ns() + kNsPerMs,
                                    cancel, server.lookup());
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, Fault::timeout);
}

TEST(HostLookup, LeavesWhenItIsCancelled) {
  const SilentServer server;
  WakeSignal cancel;
  std::thread closing([&] {
    server.wait_until_asked(1);
    cancel.raise();
  });
  const auto found =
      find_addresses(address_of("tcp://robot.local:5"), kNever, cancel, server.lookup());
  closing.join();
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, Fault::cancelled);
}

TEST(HostLookup, BeginsNoMoreThanSomeAtATime) {
  const SilentServer server;
  const WakeSignal never;
  Result<std::vector<HostAddress>, NetError> last = NetError(Fault::protocol, "");
  // Searches of the tests before may still be on their way to their end: they count, too.
  for (int begun = 0; begun <= kHostLookupsMax; ++begun) {
    last = find_addresses(address_of("tcp://robot.local:5"), 1, never, server.lookup());
    ASSERT_FALSE(last);
    if (last.error().fault != Fault::timeout) break;
  }
  EXPECT_EQ(last.error().fault, Fault::no_host);
  EXPECT_NE(last.error().sentence.find("too many"), std::string::npos);
  server.answer();
  const auto quick = [](const std::string&, std::uint16_t) {
    return HostAddresses{"", {HostAddress(16)}};
  };
  while (!find_addresses(address_of("tcp://robot.local:5"), kNever, never, quick))
    std::this_thread::yield();
}

}  // namespace
}  // namespace gimnet::net
