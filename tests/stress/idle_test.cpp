#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <exception>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// Ten thousand nodes that do nothing but keep alive: provable is what each costs the hub in memory.

namespace gimnet::stress {
namespace {

constexpr std::size_t kNodes = 10'000;
constexpr std::size_t kProcesses = 4;
constexpr std::int64_t kBytesPerNode = 1'024;

/// A process that holds idle nodes and keeps them alive until it is ended.
class Holder {
 public:
  Holder(const HubProcess& hub, std::size_t nodes) {
    std::array<int, 2> ends{};
    if (::pipe(ends.data()) != 0) throw std::runtime_error("pipe");
    pid_ = ::fork();
    if (pid_ == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      hold(hub, nodes, ends[1]);
    }
    ::close(ends[1]);
    told_ = Descriptor(ends[0]);
  }
  Holder(Holder&& other) noexcept
      : pid_(std::exchange(other.pid_, -1)), told_(std::move(other.told_)) {}
  ~Holder() {
    if (pid_ <= 0) return;
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  /// Waits until all its nodes have joined. False: they could not.
  [[nodiscard]] bool wait_joined() const {
    wait_readable({told_.get()}, 60'000);
    char byte = 0;
    return ::read(told_.get(), &byte, 1) == 1;
  }

 private:
  [[noreturn]] static void hold(const HubProcess& hub, std::size_t count, int told) {
    try {
      raise_descriptor_limit();
      std::deque<RawNode> nodes;
      while (nodes.size() < count) {
        nodes.emplace_back(hub.tcp_url());
        if (nodes.size() % 100 == 0) keep_alive(nodes);
      }
      if (::write(told, "j", 1) != 1) ::_exit(1);
      for (;;) {
        wait_readable({}, 50);
        keep_alive(nodes);
      }
    } catch (const std::exception& error) {
      ::write(STDERR_FILENO, error.what(), std::string(error.what()).size());
      ::_exit(1);
    }
  }
  static void keep_alive(std::deque<RawNode>& nodes) {
    for (RawNode& node : nodes) {
      node.keep_alive();
      node.read_some(256);
      while (node.next()) {
      }
    }
  }

  pid_t pid_ = -1;
  Descriptor told_;
};

TEST(IdleNodes, CostTheHubAtMostOneKibibyteEach) {
  if (raise_descriptor_limit() < kNodes + 100)
    GTEST_SKIP() << "the hub may hold too few descriptors here";
  // Keep-alive goes on as always; only its end waits longer, for holders that a busy machine does
  // not schedule in time.
  const HubProcess hub({"--shards", "2", "--limit", "silent_ms=60000"});
  const std::int64_t before = hub.resident_bytes();
  std::vector<Holder> holders;
  for (std::size_t i = 0; i < kProcesses; ++i) holders.emplace_back(hub, kNodes / kProcesses);
  for (const Holder& holder : holders) ASSERT_TRUE(holder.wait_joined());
  RawNode observer(hub.unix_url());
  // Through three rounds of keep-alive: what a node costs while it lives, not while it joins.
  const Clock::time_point enough = Clock::now() + std::chrono::seconds(3);
  std::int64_t highest = 0;
  while (Clock::now() < enough) {
    observer.keep_alive();
    observer.read_some();
    while (observer.next()) {
    }
    wait_readable({}, 100);
    highest = std::max(highest, hub.resident_bytes());
  }
  const Statistics end = Statistics::of(observer);
  EXPECT_EQ(end["connections"], kNodes + 1) << end.text();
  EXPECT_EQ(end["silent"], 0u);
  EXPECT_EQ(end["accepted"] + end["delivered"] + end.dropped(), 0u) << "nobody sent anything";
  EXPECT_LE((highest - before) / static_cast<std::int64_t>(kNodes), kBytesPerNode)
      << before << " bytes before, " << highest << " with " << kNodes << " nodes";
}

}  // namespace
}  // namespace gimnet::stress
