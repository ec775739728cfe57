#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <memory>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "tests/stress/support/api_caller.hpp"
#include "tests/stress/support/cutting_proxy.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/playground.hpp"
#include "tests/stress/support/size.hpp"
#include "tests/stress/support/socket.hpp"

// Eight threads call the whole API by chance, with handles that they share, while connections are
// cut, nodes take other names, handles are closed under their users, and the hub is killed.
// Provable is: nothing crashes, each call returns in time, messages and replies are whole, each
// request ends once and says rightly whether it was done, a call of each important kind succeeds,
// and nothing is left. GIMNET_STRESS_SEED=N draws the same calls again; the threads meet otherwise
// each time.

namespace gimnet::stress {
namespace {

#if defined(__has_feature)
#define GIMNET_HAS_FEATURE(name) __has_feature(name)
#else
#define GIMNET_HAS_FEATURE(name) 0
#endif
constexpr bool kThreadSanitizer = GIMNET_HAS_FEATURE(thread_sanitizer);
constexpr bool kAddressSanitizer = GIMNET_HAS_FEATURE(address_sanitizer);

constexpr std::size_t kThreads = 8;
constexpr std::size_t kProxies = 4;

/// `sanitized`: whether the build's sanitizer is the one that this test is for.
std::chrono::seconds time_to_run(bool sanitized) {
  return std::chrono::seconds(is_full_size() || sanitized ? 60 : 2);
}

std::uint64_t seed() {
  const char* const given = std::getenv("GIMNET_STRESS_SEED");
  if (given != nullptr) return std::strtoull(given, nullptr, 10);
  return is_full_size() ? std::random_device()() : 1;
}

std::size_t entries(const char* folder) {
  using Iterator = std::filesystem::directory_iterator;
  return static_cast<std::size_t>(std::distance(Iterator(folder), Iterator()));
}

/// Threads and descriptors of this process.
struct Belongings {
  std::size_t threads = entries("/proc/self/task");
  std::size_t descriptors = entries("/proc/self/fd");
  friend bool operator==(const Belongings&, const Belongings&) = default;
};

/// Each of these calls has to succeed once: a run in which nothing works proves nothing.
constexpr std::array kHaveToSucceed{"join",   "advertise", "publish",  "subscribe", "receive",
                                    "accept", "send",      "answer",   "ask_later", "next_request",
                                    "find",   "nodes",     "services", "watch"};
/// A run goes on for so long until they have: few calls are made on a machine that is busy.
constexpr std::chrono::seconds kLongest{60};
constexpr std::size_t kForks = 5;

/// Calls of those that did not succeed yet, in words.
std::string missing(Playground& playground) {
  const std::set<std::string> calls = playground.successes.calls();
  std::string words;
  for (const char* const name : kHaveToSucceed)
    if (!calls.contains(name)) words += std::string(name) + ", ";
  if (!playground.requests.has_done()) words += "a reply, ";
  return words;
}

/// The work of the main thread beside the eight: it breaks things.
class Breaker {
 public:
  Breaker(Playground& playground, HubProcess& hub, std::uint64_t seed)
      : playground_(playground), hub_(hub), caller_(playground, seed) {
    playground.hubs = {hub.tcp_url(), hub.unix_url(), hub.unix_url(), "tcp://127.0.0.1:1"};
    for (std::size_t i = 0; i < kProxies; ++i) {
      const CutPlan plan{SIZE_MAX, 200'000, {}, static_cast<std::uint32_t>(seed + i)};
      proxies_.push_back(std::make_unique<CuttingProxy>(hub.tcp_url(), plan));
      playground.hubs.push_back(proxies_.back()->url());
    }
  }

  void run(std::chrono::seconds time, bool with_forks) {
    const auto end = Clock::now() + time;
    const auto latest = end + kLongest;
    auto kill = Clock::now() + time / 2;
    auto fork = Clock::now();
    const auto goes_on = [&] {
      const auto now = Clock::now();
      if (now < end || now >= latest) return now < end;
      return (with_forks && forks_ < kForks) || !missing(playground_).empty();
    };
    while (goes_on()) {
      caller_.call_one();
      if (caller_.one_in(40)) proxies_[caller_.below(kProxies)]->cut_now();
      if (with_forks && Clock::now() >= fork) {
        fork_once();
        fork = Clock::now() + std::chrono::milliseconds(100);
      }
      if (Clock::now() < kill) continue;
      kill = Clock::now() + std::chrono::seconds(10);
      hub_.kill_and_restart();
    }
  }
  [[nodiscard]] std::size_t forks() const { return forks_; }
  [[nodiscard]] ApiCaller& caller() { return caller_; }

 private:
  /// The child calls everything with what the parent has, joins anew, and ends.
  void fork_once() {
    playground_.handles.lock();
    playground_.requests.lock();
    const pid_t child = ::fork();
    playground_.requests.unlock();
    playground_.handles.unlock();
    if (child == 0) {
      ::alarm(60);
      caller_.call_all_in_child();
      gimi_node_options options{};
      options.struct_size = sizeof options;
      options.hub = hub_.unix_url().c_str();
      gimi_handle node = 0;
      gimi_handle publisher = 0;
      EXPECT_EQ(gimi_join(&options, &node), GIMI_OK) << gimi_error_text();
      EXPECT_EQ(gimi_subscribe(node, "robot/x", nullptr, &publisher), GIMI_OK) << gimi_error_text();
      EXPECT_EQ(gimi_close(publisher), GIMI_OK);
      EXPECT_EQ(gimi_close(node), GIMI_OK);
      ::_exit(testing::Test::HasFailure() ? 1 : 0);
    }
    if (child < 0) throw std::runtime_error("fork");
    ++forks_;
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_EQ(status, 0) << (WIFSIGNALED(status) ? "a child was ended by signal "
                                                 : "a child failed, status ")
                         << (WIFSIGNALED(status) ? WTERMSIG(status) : status);
  }

  Playground& playground_;
  HubProcess& hub_;
  ApiCaller caller_;
  std::vector<std::unique_ptr<CuttingProxy>> proxies_;
  std::size_t forks_ = 0;
};

/// Every request that is still open ends by its deadline; then all handles are closed.
void clean_up(Playground& playground, ApiCaller& caller) {
  for (const gimi_handle pending : playground.handles.take_all(Kind::pending)) {
    gimi_reply reply{};
    const gimi_status status =
        caller.timed(1500, [&] { return gimi_wait_for_reply(pending, 1500, &reply); });
    EXPECT_FALSE(status == GIMI_TIMEOUT && reply.ended == 0) << "a request did not end";
    if (reply.ended != 0) playground.requests.ended_later(pending, status, reply.ran);
    gimi_reply_release(&reply);
    caller.close(pending);
  }
  caller.release_all();
  // Nodes first: of a closed one the ends of its handles do not ask the hub.
  for (std::size_t kind = 1; kind <= kKinds; ++kind) {
    for (const gimi_handle handle : playground.handles.take_all(static_cast<Kind>(kind))) {
      caller.close(handle);
      EXPECT_EQ(gimi_close(handle), GIMI_CLOSED);
    }
  }
}

void call_all(std::chrono::seconds time, bool with_forks) {
  const std::uint64_t first_seed = seed();
  const testing::ScopedTrace trace(__FILE__, __LINE__,
                                   "GIMNET_STRESS_SEED=" + std::to_string(first_seed));
  HubProcess hub({"--shards", "2"});
  std::thread([] {}).join();  // a sanitizer begins a thread of its own with the first one
  const Belongings before;
  Playground playground;
  std::uint64_t calls = 0;
  std::string worst;
  {
    Breaker breaker(playground, hub, first_seed);
    std::vector<std::unique_ptr<ApiCaller>> callers;
    for (std::size_t i = 0; i < kThreads; ++i)
      callers.push_back(std::make_unique<ApiCaller>(playground, first_seed + i + 1));
    std::atomic<bool> over = false;
    std::vector<std::thread> threads;
    for (const auto& caller : callers) {
      threads.emplace_back([&over, &caller] {
        while (!over) caller->call_one();
      });
    }
    try {
      breaker.run(time, with_forks);
    } catch (const std::exception& error) {
      ADD_FAILURE() << error.what();
    }
    over = true;
    for (std::thread& thread : threads) thread.join();
    for (const auto& caller : callers) {
      caller->release_all();
      calls += caller->calls();
      worst += caller->worst() + "\n";
    }
    clean_up(playground, breaker.caller());
    if (with_forks) {
      EXPECT_GE(breaker.forks(), kForks);
    }
  }
  const Deadline deadline;
  while (Belongings() != before && !deadline.is_over()) wait_readable({}, 10);
  EXPECT_EQ(Belongings().threads, before.threads) << "threads are left";
  EXPECT_EQ(Belongings().descriptors, before.descriptors) << "descriptors are left";
  EXPECT_EQ(missing(playground), "") << "did not succeed";
  const std::string ends = playground.requests.check();
  const std::set<std::string> succeeded = playground.successes.calls();
  testing::Test::RecordProperty("calls", std::to_string(calls));
  testing::Test::RecordProperty("succeeded", std::to_string(succeeded.size()));
  testing::Test::RecordProperty("worst", worst);
  testing::Test::RecordProperty("ends", ends);
  if (std::getenv("GIMNET_STRESS_SEED") != nullptr || testing::Test::HasFailure()) {
    std::string names;
    for (const std::string& name : succeeded) names += name + ", ";
    printf("seed %llu, %llu calls, of which succeeded: %s\n%s%s",
           static_cast<unsigned long long>(first_seed), static_cast<unsigned long long>(calls),
           names.c_str(), worst.c_str(), ends.c_str());
  }
}

TEST(WholeApi, StandsRandomCallsOfEightThreads) { call_all(time_to_run(kThreadSanitizer), false); }

TEST(WholeApi, StandsRandomCallsAndForks) {
  if (kThreadSanitizer) GTEST_SKIP() << "a child with threads dies under ThreadSanitizer";
  call_all(time_to_run(kAddressSanitizer), true);
}

}  // namespace
}  // namespace gimnet::stress
