#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <future>
#include <string>

#include "proto/control/ctrl.hpp"
#include "proto/control/ns.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/size.hpp"
#include "tests/stress/support/statistics.hpp"

// The configuration is read again and again while data flows: provable is that no connection ends,
// no frame is lost or overtaken, the ledger is exact, and that what every configuration forbids,
// and what nobody may who is no administrator, never once succeeds, whoever tries it at whatever
// moment.

namespace gimnet::stress {
namespace {

namespace ns = proto::ns;
namespace ctrl = proto::ctrl;
using proto::Kind;

constexpr std::uint32_t kServicesMost = 3;
constexpr std::uint64_t kBatch = 64;

/// The configuration file of a hub, replaced as a whole each time.
class ConfigFile {
 public:
  ConfigFile() {
    std::string pattern =
        (std::filesystem::temp_directory_path() / "gimnet-reload-XXXXXX").string();
    if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("mkdtemp");
    folder_ = pattern;
    write_good(0);
  }
  ~ConfigFile() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  ConfigFile(const ConfigFile&) = delete;
  ConfigFile& operator=(const ConfigFile&) = delete;

  [[nodiscard]] std::string path() const { return folder_ + "/hub.toml"; }
  /// Two that allow different things, neither of them more than kServicesMost services and watches
  /// over 4 messages.
  void write_good(std::size_t number) const {
    const std::size_t odd = number % 2;
    write("[limits]\nservices_per_node = " + std::to_string(kServicesMost - odd) +
          "\nlane1_bytes = " + std::to_string((1 + odd) << 20) +
          "\ncontrol_bytes = " + std::to_string((1 + odd) << 18) +
          "\nnodes = " + std::to_string(50 + odd) + "\nsubscriptions_per_node = 1000\n");
  }
  /// It would allow everything, and has a fault at its end.
  void write_bad() const {
    write(
        "[limits]\nservices_per_node = 1000\nnodes = 1000\nsubscriptions_per_node = 1000\nnods = "
        "3\n");
  }

 private:
  void write(const std::string& text) const {
    const std::string fresh = folder_ + "/fresh";
    {
      std::ofstream file(fresh);
      file << text;
      if (!file.flush()) throw std::runtime_error("cannot write " + fresh);
    }
    std::filesystem::rename(fresh, path());
  }
  std::string folder_;
};

/// Sends numbered frames from one shard to the other, and back, and counts them, until it is told
/// to stop.
class Load {
 public:
  explicit Load(const HubProcess& hub)
      : nodes_{RawNode(hub.tcp_url(), at_shard(0)), RawNode(hub.tcp_url(), at_shard(1))} {}

  void run(const std::atomic<bool>& stop) {
    while (!stop.load()) exchange();
  }
  [[nodiscard]] std::uint64_t sent() const { return sent_[0] + sent_[1]; }
  [[nodiscard]] bool is_whole() const {
    return received_ == sent_ && !nodes_[0].is_closed() && !nodes_[1].is_closed();
  }

 private:
  static JoinOptions at_shard(std::uint16_t shard) {
    JoinOptions options;
    options.hello.shard = shard;
    return options;
  }
  /// A batch each way, until all of it is there: what is lost is missed at once.
  void exchange() {
    for (std::size_t from = 0; from < 2; ++from) {
      for (std::uint64_t i = 0; i < kBatch; ++i) {
        const std::uint64_t sequence = ++sent_[from];
        nodes_[from].put(parts_of(Kind::unicast, nodes_[1 - from].id().value()),
                         std::as_bytes(std::span(&sequence, 1)));
      }
    }
    const Deadline deadline;
    while (received_ != sent_) {
      deadline.check("the frames of a batch");
      for (std::size_t i = 0; i < 2; ++i) {
        nodes_[i].flush();
        take(i);
      }
      if (received_ != sent_) wait_readable({nodes_[0].descriptor(), nodes_[1].descriptor()}, 10);
    }
  }
  void take(std::size_t to) {
    while (nodes_[to].read_some()) {
      while (const auto frame = nodes_[to].next()) {
        if (frame->header.kind != Kind::unicast) continue;
        std::uint64_t sequence = 0;
        std::memcpy(&sequence, frame->body().data(), sizeof sequence);
        if (sequence != ++received_[1 - to])
          throw std::runtime_error("a frame was lost or overtaken");
      }
    }
    if (nodes_[to].is_closed()) throw std::runtime_error("a connection was dropped");
  }

  std::array<RawNode, 2> nodes_;
  std::array<std::uint64_t, 2> sent_{};
  std::array<std::uint64_t, 2> received_{};
};

/// Tries what is forbidden, again and again.
class Rival {
 public:
  explicit Rival(const HubProcess& hub) : hub_(hub) {
    JoinOptions options;
    options.hello.name = "rival";
    node_ = RawNode(hub.unix_url(), options);
    // As many as the stricter file allows: what it has it keeps, whatever is read.
    for (std::uint32_t i = 0; i < kServicesMost; ++i) offer(i);
  }
  void run(const std::atomic<bool>& stop) {
    while (!stop.load()) try_everything();
  }
  [[nodiscard]] std::uint64_t rounds() const { return rounds_.load(); }
  [[nodiscard]] std::uint64_t successes() const { return successes_; }
  [[nodiscard]] bool is_closed() const { return node_.is_closed(); }

 private:
  void offer(std::uint32_t number) {
    ns::Advertise service;
    service.service = "s" + std::to_string(number);
    static_cast<void>(node_.ask<ns::AdvertiseAnswer>(Kind::ns, service));
  }
  void try_everything() {
    ns::Advertise beyond;
    beyond.service = "beyond";
    refused(node_.try_ask<ns::AdvertiseAnswer>(Kind::ns, beyond), proto::Status::limit);
    // The file says 1,000, and the flag, which is stronger, 4.
    ns::Subscribe wide;
    wide.name = "rival/s0";
    wide.window = 5;
    refused(node_.try_ask<ns::SubscribeAnswer>(Kind::ns, wide), proto::Status::bad_request);
    refused(node_.try_ask<ctrl::ReloadAnswer>(Kind::ctrl, ctrl::Reload{}), proto::Status::denied);
    refused(node_.try_ask<ctrl::KickAnswer>(Kind::ctrl, ctrl::Kick{node_.id(), "myself"}),
            proto::Status::denied);
    if (rounds_.load() % 8 == 0) try_to_administer();
    rounds_.fetch_add(1);
  }
  template <class Answer>
  void refused(const Answer& answer, proto::Status status) {
    if (answer.has_value() || answer.error().status != status) ++successes_;
  }
  /// Over TCP nobody is an administrator.
  void try_to_administer() {
    JoinOptions options;
    options.hello.role = proto::Role::admin;
    RawNode stranger;
    stranger.begin_join(hub_.tcp_url(), options);
    const Deadline deadline;
    try {
      while (!stranger.finish_join()) {
        deadline.check("an answer to HELLO");
        wait_readable({stranger.descriptor()}, 10);
      }
      ++successes_;
    } catch (const std::runtime_error&) {
      if (!stranger.goodbye() || stranger.goodbye()->code != proto::GoodbyeCode::not_allowed) throw;
    }
  }

  const HubProcess& hub_;
  RawNode node_;
  std::atomic<std::uint64_t> rounds_{0};
  std::uint64_t successes_ = 0;
};

/// Has the configuration read again.
class Reloads {
 public:
  Reloads(const HubProcess& hub, const ConfigFile& file) : hub_(hub), file_(file) {
    JoinOptions options;
    options.hello.role = proto::Role::admin;
    admin_ = RawNode(hub.unix_url(), options);
  }
  void one(std::size_t number) {
    if (number % 16 == 15) return bad();
    file_.write_good(number);
    // Both ways at once, now and then.
    if (number % 8 == 3) ::kill(hub_.pid(), SIGHUP);
    const auto answer = admin_.ask<ctrl::ReloadAnswer>(Kind::ctrl, ctrl::Reload{});
    for (const ctrl::ChangeRecord& change : answer.changes) {
      EXPECT_FALSE(change.needs_restart) << change.key;
    }
    changes_ += answer.changes.size();
  }
  [[nodiscard]] std::uint64_t changes() const { return changes_; }
  [[nodiscard]] RawNode& admin() { return admin_; }

 private:
  void bad() {
    file_.write_bad();
    const auto answer = admin_.try_ask<ctrl::ReloadAnswer>(Kind::ctrl, ctrl::Reload{});
    ASSERT_FALSE(answer.has_value());
    EXPECT_EQ(answer.error().status, proto::Status::bad_request);
    EXPECT_NE(answer.error().sentence.find("hub.toml:5:1"), std::string::npos)
        << answer.error().sentence;
  }

  const HubProcess& hub_;
  const ConfigFile& file_;
  RawNode admin_;
  std::uint64_t changes_ = 0;
};

bool is_running(const std::future<void>& thread) {
  return thread.wait_for(std::chrono::seconds(0)) == std::future_status::timeout;
}

TEST(Reload, NothingEndsAndNothingForbiddenSucceedsWhileItIsReadAgainAndAgain) {
  const std::size_t count = is_full_size() ? 10'000 : 300;
  const ConfigFile file;
  // A node that tries what is forbidden as often as it can must not be sent away for that.
  HubProcess hub({"--shards", "2", "--placement", "hint", "--config", file.path(), "--limit",
                  "sync_window=4", "--limit", "oddities_per_s=1000000", "--limit",
                  "oddities_burst=1000000", "--limit", "declarations_per_s=1000000", "--limit",
                  "declarations_burst=10000000"});
  Load load(hub);
  Rival rival(hub);
  Reloads reloads(hub, file);
  std::atomic<bool> stop{false};
  auto loading = std::async(std::launch::async, [&] { load.run(stop); });
  auto trying = std::async(std::launch::async, [&] { rival.run(stop); });
  // Also where this ends early: the threads are waited for after it.
  const struct Stop {
    std::atomic<bool>& stop;
    ~Stop() { stop.store(true); }
  } at_the_end{stop};
  const Clock::time_point began = Clock::now();
  for (std::size_t i = 0; i < count && !HasFailure(); ++i) {
    reloads.one(i);
    // Everything was tried at least once between two of them, and most often while one was under
    // way.
    const Deadline deadline;
    for (const std::uint64_t before = rival.rounds();
         rival.rounds() == before && is_running(trying);) {
      deadline.check("somebody who tries what is forbidden");
      wait_readable({}, 1);
    }
    if (!is_running(trying) || !is_running(loading)) break;
  }
  const double seconds = std::chrono::duration<double>(Clock::now() - began).count();
  stop.store(true);
  EXPECT_NO_THROW(loading.get());
  EXPECT_NO_THROW(trying.get());
  EXPECT_TRUE(hub.is_running());
  EXPECT_TRUE(load.is_whole());
  EXPECT_FALSE(rival.is_closed());
  EXPECT_EQ(rival.successes(), 0u) << "something forbidden was allowed for a moment";
  EXPECT_GE(rival.rounds(), count);
  EXPECT_GE(reloads.changes(), count) << "too little changed to be a test";
  const Statistics end = wait_for(
      reloads.admin(),
      [&](const Statistics& now) { return now["queued"] == 0 && now.is_balanced(); },
      "a quiet hub");
  EXPECT_EQ(end["accepted"], load.sent());
  EXPECT_EQ(end["delivered"], load.sent());
  EXPECT_EQ(end.dropped(), 0u) << end.text();
  std::printf("%zu reloads in %.1f s, %llu frames, %llu rounds of forbidden things\n", count,
              seconds, static_cast<unsigned long long>(load.sent()),
              static_cast<unsigned long long>(rival.rounds()));
}

}  // namespace
}  // namespace gimnet::stress
