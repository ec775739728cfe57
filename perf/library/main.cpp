// One of two programs that talk with each other through a hub by means of a library, the one that
// this is linked with: one sends as fast as its library takes it, or round trips go one by one.
// perf/run.py starts the hub and both, first the one that answers.
//
//     library_client_nif --role receiver --connect tcp://127.0.0.1:7450
//     library_client_nif --role sender --connect tcp://127.0.0.1:7450 --hub PID --partner PID

#include <sys/types.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "generator/messages.hpp"
#include "generator/process.hpp"
#include "generator/scenario.hpp"
#include "library/library_client.hpp"
#include "net/socket.hpp"

namespace gimnet::perf {
namespace {

using Clock = LibraryClient::Clock;

struct PairOptions {
  std::size_t payload_bytes = 16;
  std::chrono::nanoseconds duration{1'000'000'000};
  std::chrono::nanoseconds patience{2'000'000'000};  ///< a message that takes longer is lost
  pid_t hub = 0;
  pid_t partner = 0;
};

/// The time that hub and both clients used since this was made.
class ThreeProcesses {
 public:
  ThreeProcesses(pid_t sender, pid_t receiver, pid_t hub)
      : meters_{{{"sender", CpuMeter(sender)},
                 {"receiver", CpuMeter(receiver)},
                 {"hub", CpuMeter(hub)}}} {}

  /// Adds user and system time of each, and those of all together, a message.
  void add_to(Findings& findings, double messages) const {
    CpuMeter::Used all;
    for (const auto& [name, meter] : meters_) {
      const CpuMeter::Used used = meter.used();
      findings.add(std::string(name) + "_user_ns_per_message", used.user_ns / messages);
      findings.add(std::string(name) + "_system_ns_per_message", used.system_ns / messages);
      all.user_ns += used.user_ns;
      all.system_ns += used.system_ns;
    }
    findings.add("cpu_ns_per_message", (all.user_ns + all.system_ns) / messages);
    findings.add("system_ns_per_message", all.system_ns / messages);
  }

 private:
  struct Named {
    const char* name;
    CpuMeter meter;
  };
  std::array<Named, 3> meters_;
};

constexpr std::size_t kUnderWayBytesMax = 2 * 1024 * 1024;
constexpr std::uint64_t kUnderWayMax = 16'384;
/// The receiver tells after every so many of a full window what it has.
constexpr std::uint64_t kReportsPerWindow = 8;
constexpr std::uint64_t kUnderWayMin = 4;
/// Messages sent between two looks at the clock, at most.
constexpr std::uint64_t kBatchMax = 64;
constexpr std::chrono::milliseconds kAskAgain{200};
constexpr StreamId kData = 1;
constexpr StreamId kQuestion = 2;
constexpr StreamId kReport = 3;
constexpr std::size_t kReportBytes = 24;

std::uint64_t window_of(std::size_t payload_bytes) {
  return std::clamp<std::uint64_t>(kUnderWayBytesMax / payload_bytes, kUnderWayMin, kUnderWayMax);
}

/// Sends numbered messages and knows what became of them.
class BurstSender {
 public:
  BurstSender(LibraryClient& client, LibraryClient::Setup setup, const PairOptions& options)
      : client_(client), options_(options), window_(window_of(options.payload_bytes)) {
    const auto pattern = pattern_payload(options.payload_bytes);
    payload_.assign(pattern.begin(), pattern.end());
    setup.is_bursty = true;
    client.open(setup, [this](std::span<const std::byte> message) { on_message(message); });
  }

  /// As fast as it goes.
  void run(std::chrono::nanoseconds duration) {
    const std::uint64_t batch = std::min(kBatchMax, window_ / kUnderWayMin);
    for (const auto end = Clock::now() + duration; Clock::now() < end;) {
      if (sent_ + batch - settled() > window_) {
        if (!client_.wait(Clock::now() + kAskAgain)) settle();
        continue;
      }
      for (std::uint64_t count = 0; count < batch; ++count) {
        store_le(payload_.data(), make_stamp(kData, sent_++));
        client_.send(payload_);
      }
    }
  }

  /// Until it is known what became of every message. What is asked travels behind them all.
  void settle() {
    const auto deadline = Clock::now() + options_.patience;
    const std::uint64_t answers_before = answers_.load();
    while (answers_.load() == answers_before) {
      if (Clock::now() > deadline) fail("the receiver does not answer");
      std::array<std::byte, kStampBytes> question;
      store_le(question.data(), make_stamp(kQuestion, 0));
      client_.send(question);
      const auto ask_again = Clock::now() + kAskAgain;
      while (answers_.load() == answers_before && client_.wait(ask_again)) {
      }
    }
    lost_ = sent_ - delivered_.load();
  }

  [[nodiscard]] std::uint64_t delivered() const { return delivered_.load(); }
  [[nodiscard]] std::uint64_t lost() const { return lost_; }
  [[nodiscard]] std::uint64_t wrong() const { return wrong_.load(); }

 private:
  [[nodiscard]] std::uint64_t settled() const { return delivered_.load() + lost_; }

  void on_message(std::span<const std::byte> message) {
    if (message.size() != kReportBytes) fail("something else than a report came");
    delivered_.store(load_le<std::uint64_t>(message.data() + 8));
    wrong_.store(load_le<std::uint64_t>(message.data() + 16));
    if ((load_le<std::uint64_t>(message.data()) & 1) != 0) answers_.fetch_add(1);
    client_.wake();
  }

  LibraryClient& client_;
  const PairOptions options_;
  const std::uint64_t window_;
  std::vector<std::byte> payload_;
  std::uint64_t sent_ = 0;
  std::uint64_t lost_ = 0;
  std::atomic<std::uint64_t> delivered_{0};
  std::atomic<std::uint64_t> wrong_{0};
  std::atomic<std::uint64_t> answers_{0};
};

/// The cost of `work` for all three processes. It returns the number of messages that it passed.
template <class Work>
Findings measured(const PairOptions& options, const Work& work) {
  const auto begin = Clock::now();
  const ThreeProcesses processes(::getpid(), options.partner, options.hub);
  const auto messages = static_cast<double>(work());
  const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  Findings findings;
  findings.add("messages_per_second", messages / seconds);
  findings.add("messages", messages);
  processes.add_to(findings, std::max(1.0, messages));
  return findings;
}

/// Says that it is ready, and then only answers.
[[noreturn]] void serve(LibraryClient& client) {
  std::puts("ready");
  std::fflush(stdout);
  for (;;) static_cast<void>(client.wait(Clock::now() + kAskAgain));
}

/// Sends, with a bounded number of messages under way, and says what it cost all three processes.
Findings send_bursts(LibraryClient& client, LibraryClient::Setup setup,
                     const PairOptions& options) {
  BurstSender sender(client, std::move(setup), options);
  sender.run(options.duration / 5);  // to warm up
  sender.settle();
  const std::uint64_t delivered_before = sender.delivered();
  Findings findings = measured(options, [&] {
    sender.run(options.duration);
    sender.settle();
    return sender.delivered() - delivered_before;
  });
  findings.add("lost", static_cast<double>(sender.lost()));
  findings.add("wrong", static_cast<double>(sender.wrong()));
  return findings;
}

/// The other end of send_bursts(): checks every message and says from time to time how many it has.
[[noreturn]] void receive_bursts(LibraryClient& client, LibraryClient::Setup setup,
                                 const PairOptions& options) {
  Inbox inbox;
  inbox.expect(kData, options.payload_bytes);
  const std::uint64_t report_every =
      std::max<std::uint64_t>(1, window_of(options.payload_bytes) / kReportsPerWindow);
  std::uint64_t next_report = report_every;
  const auto report = [&](bool is_answer) {
    std::array<std::byte, kReportBytes> message;
    store_le(message.data(), make_stamp(kReport, is_answer ? 1 : 0));
    store_le(message.data() + 8, inbox.delivered());
    store_le(message.data() + 16, inbox.wrong());
    client.send(message);
  };
  client.open(setup, [&](std::span<const std::byte> message) {
    const bool is_question = message.size() == kStampBytes;
    if (!is_question) inbox.on_message(message);
    if (!is_question && inbox.delivered() < next_report) return;
    next_report = inbox.delivered() + report_every;
    report(is_question);
  });
  serve(client);
}

/// Sends a message, and the next when it has come back.
class Pinger {
 public:
  Pinger(LibraryClient& client, const LibraryClient::Setup& setup, const PairOptions& options)
      : client_(client), options_(options) {
    const auto pattern = pattern_payload(options.payload_bytes);
    payload_.assign(pattern.begin(), pattern.end());
    inbox_.expect(kData, options.payload_bytes);
    client.open(setup, [this](std::span<const std::byte> message) { on_message(message); });
  }

  /// Until the time is up or one is lost.
  void run(std::chrono::nanoseconds duration) {
    const auto end = Clock::now() + duration;
    {
      const std::lock_guard lock(mutex_);
      done_.store(false);
      end_ = end;
      send_next();
    }
    const auto deadline = end + options_.patience;
    while (!done_.load() && Clock::now() < deadline) static_cast<void>(client_.wait(deadline));
  }

  void forget_round_trips() { round_trips_ns_.clear(); }
  [[nodiscard]] std::vector<std::int64_t>& round_trips_ns() { return round_trips_ns_; }
  [[nodiscard]] std::uint64_t lost() const {
    return done_.load() ? inbox_.lost() : inbox_.lost() + 1;
  }
  [[nodiscard]] std::uint64_t wrong() const { return inbox_.wrong(); }

 private:
  void send_next() {
    store_le(payload_.data(), make_stamp(kData, sequence_++));
    begin_ = Clock::now();
    client_.send(payload_);
  }

  void on_message(std::span<const std::byte> message) {
    const auto now = Clock::now();
    const std::lock_guard lock(mutex_);
    inbox_.on_message(message);
    round_trips_ns_.push_back((now - begin_).count());
    if (now < end_) {
      send_next();
    } else {
      done_.store(true);
      client_.wake();
    }
  }

  LibraryClient& client_;
  const PairOptions options_;
  std::atomic<bool> done_{false};

  // The main thread's to begin with, then the library's, which says by done_ that it is through.
  std::mutex mutex_;
  std::vector<std::byte> payload_;
  Inbox inbox_;
  std::uint64_t sequence_ = 0;
  Clock::time_point begin_;
  Clock::time_point end_;
  std::vector<std::int64_t> round_trips_ns_;
};

Findings make_round_trips(LibraryClient& client, LibraryClient::Setup setup,
                          const PairOptions& options) {
  Pinger pinger(client, setup, options);
  pinger.run(options.duration / 5);  // to warm up
  pinger.forget_round_trips();
  Findings findings = measured(options, [&] {
    pinger.run(options.duration);
    return 2 * pinger.round_trips_ns().size();
  });
  add_percentiles(findings, pinger.round_trips_ns());
  findings.add("lost", static_cast<double>(pinger.lost()));
  findings.add("wrong", static_cast<double>(pinger.wrong()));
  return findings;
}

/// So many requests, and then so many plain round trips: in turns, so that both have the same
/// conditions.
constexpr std::uint64_t kTurn = 64;

/// Asks, and sends plain messages around, one after the other.
Findings make_requests(LibraryClient& client, const LibraryClient::Setup& setup,
                       const PairOptions& options) {
  const auto pattern = pattern_payload(options.payload_bytes);
  std::vector<std::byte> payload(pattern.begin(), pattern.end());
  std::vector<std::int64_t> requests_ns;
  std::vector<std::int64_t> plain_ns;
  std::uint64_t number = 0;
  const auto one_turn = [&](std::vector<std::int64_t>& times_ns, auto go) {
    for (std::uint64_t count = 0; count < kTurn; ++count) {
      store_le(payload.data(), make_stamp(kData, number++));
      const auto begin = Clock::now();
      go();
      times_ns.push_back((Clock::now() - begin).count());
    }
  };
  const auto run = [&](std::chrono::nanoseconds duration) {
    requests_ns.clear();
    plain_ns.clear();
    for (const auto end = Clock::now() + duration; Clock::now() < end;) {
      one_turn(requests_ns, [&] { client.ask(payload); });
      one_turn(plain_ns, [&] { client.send_round(payload); });
    }
  };
  client.begin_asking(setup);
  run(options.duration / 5);  // to warm up
  const auto begin = Clock::now();
  const ThreeProcesses processes(::getpid(), options.partner, options.hub);
  run(options.duration);
  const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  const auto messages = 2 * static_cast<double>(requests_ns.size() + plain_ns.size());
  Findings findings;
  add_percentiles(findings, requests_ns);
  std::ranges::sort(plain_ns);
  std::ranges::sort(requests_ns);
  const auto middle = [](const std::vector<std::int64_t>& times_ns) {
    return static_cast<double>(times_ns[times_ns.size() / 2]);
  };
  findings.add("plain_p50_us", middle(plain_ns) / 1000);
  findings.add("request_over_plain", middle(requests_ns) / middle(plain_ns));
  findings.add("messages_per_second", messages / seconds);
  findings.add("messages", messages);
  processes.add_to(findings, messages);
  return findings;
}

[[noreturn]] void answer_requests(LibraryClient& client, const LibraryClient::Setup& setup) {
  client.answer(setup);
  serve(client);
}

[[noreturn]] void echo(LibraryClient& client, const LibraryClient::Setup& setup) {
  client.open(setup, [&client](std::span<const std::byte> message) { client.send(message); });
  serve(client);
}

}  // namespace
}  // namespace gimnet::perf

int main(int argc, char** argv) {
  using namespace gimnet::perf;
  CLI::App app{"library_client: one of two programs that talk through a hub"};
  std::string role;
  LibraryClient::Setup setup;
  PairOptions options;
  double seconds = 1;
  double patience = 2;
  app.add_option("--role", role)
      ->required()
      ->check(CLI::IsMember({"sender", "receiver", "pinger", "echo", "asker", "answerer"}));
  app.add_option("--connect", setup.url, "tcp://HOST:PORT or unix:PATH")->required();
  app.add_option("--hub", options.hub, "process id of the hub, for who measures");
  app.add_option("--partner", options.partner, "process id of the partner, for who measures");
  app.add_option("--size", options.payload_bytes, "payload in bytes")
      ->check(CLI::Range(kPayloadBytesMin, kPayloadBytesMax));
  app.add_option("--seconds", seconds, "how long is measured")->check(CLI::Range(0.01, 3600.0));
  app.add_option("--patience", patience, "seconds after which a message that has not come is lost")
      ->check(CLI::Range(0.1, 600.0));
  CLI11_PARSE(app, argc, argv);

  options.duration = std::chrono::nanoseconds(static_cast<std::int64_t>(seconds * 1e9));
  options.patience = std::chrono::nanoseconds(static_cast<std::int64_t>(patience * 1e9));
  setup.is_first = role == "receiver" || role == "echo" || role == "answerer";
  setup.is_burst = role == "receiver" || role == "sender";
  setup.own = setup.is_first ? "second" : "first";
  setup.partner = setup.is_first ? "first" : "second";
  const auto client = make_library_client();
  if (role == "receiver") receive_bursts(*client, setup, options);
  if (role == "echo") echo(*client, setup);
  if (role == "answerer") answer_requests(*client, setup);
  Findings findings = role == "sender"  ? send_bursts(*client, setup, options)
                      : role == "asker" ? make_requests(*client, setup, options)
                                        : make_round_trips(*client, setup, options);
  findings.add("rss_peak_bytes", static_cast<double>(peak_resident_bytes(options.hub)));
  std::puts(findings.json().c_str());
}
