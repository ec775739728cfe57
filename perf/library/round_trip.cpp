#include <atomic>
#include <cstdint>
#include <mutex>
#include <vector>

#include "generator/messages.hpp"
#include "library/pair.hpp"
#include "net/socket.hpp"

namespace gimnet::perf {
namespace {

using Clock = LibraryClient::Clock;

constexpr StreamId kThere = 1;
constexpr std::chrono::milliseconds kLookAgain{200};

/// Sends a message, and the next when it has come back.
class Pinger {
 public:
  Pinger(LibraryClient& client, const LibraryClient::Setup& setup, const PairOptions& options)
      : client_(client), options_(options) {
    const auto pattern = pattern_payload(options.payload_bytes);
    payload_.assign(pattern.begin(), pattern.end());
    inbox_.expect(kThere, options.payload_bytes);
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
    store_u64(payload_.data(), make_stamp(kThere, sequence_++));
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

}  // namespace

Findings make_round_trips(LibraryClient& client, LibraryClient::Setup setup,
                          const PairOptions& options) {
  Pinger pinger(client, setup, options);
  pinger.run(options.duration / 5);  // to warm up
  pinger.forget_round_trips();
  const auto begin = Clock::now();
  const ThreeProcesses processes(::getpid(), options.partner, options.hub);
  pinger.run(options.duration);
  const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  const auto messages = 2 * static_cast<double>(pinger.round_trips_ns().size());
  Findings findings;
  add_percentiles(findings, pinger.round_trips_ns());
  findings.add("messages_per_second", messages / seconds);
  findings.add("messages", messages);
  processes.add_to(findings, std::max(1.0, messages));
  findings.add("lost", static_cast<double>(pinger.lost()));
  findings.add("wrong", static_cast<double>(pinger.wrong()));
  return findings;
}

void echo(LibraryClient& client, LibraryClient::Setup setup, const PairOptions&) {
  client.open(setup, [&client](std::span<const std::byte> message) { client.send(message); });
  say_ready();
  for (;;) static_cast<void>(client.wait(Clock::now() + kLookAgain));
}

}  // namespace gimnet::perf
