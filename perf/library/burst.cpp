#include <algorithm>
#include <array>
#include <atomic>
#include <vector>

#include "generator/messages.hpp"
#include "library/pair.hpp"
#include "net/socket.hpp"

namespace gimnet::perf {
namespace {

using Clock = LibraryClient::Clock;

constexpr std::size_t kUnderWayBytesMax = 2 * 1024 * 1024;
constexpr std::uint64_t kUnderWayMax = 16'384;
/// The receiver tells after every so many of a full window what it has.
constexpr std::uint64_t kReportsPerWindow = 8;
/// Messages sent between two looks at the clock.
constexpr std::uint64_t kBatch = 64;
constexpr std::chrono::milliseconds kAskAgain{200};
constexpr StreamId kData = 1;
constexpr StreamId kQuestion = 2;
constexpr StreamId kReport = 3;
constexpr std::size_t kReportBytes = 24;

std::uint64_t window_of(std::size_t payload_bytes) {
  return std::clamp<std::uint64_t>(kUnderWayBytesMax / payload_bytes, kBatch, kUnderWayMax);
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
    for (const auto end = Clock::now() + duration; Clock::now() < end;) {
      if (sent_ + kBatch - settled() > window_) {
        if (!client_.wait(Clock::now() + kAskAgain)) settle();
        continue;
      }
      for (std::uint64_t count = 0; count < kBatch; ++count) {
        store_u64(payload_.data(), make_stamp(kData, sent_++));
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
      store_u64(question.data(), make_stamp(kQuestion, 0));
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
    delivered_.store(load_u64(message.data() + 8));
    wrong_.store(load_u64(message.data() + 16));
    if ((load_u64(message.data()) & 1) != 0) answers_.fetch_add(1);
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

}  // namespace

Findings send_bursts(LibraryClient& client, LibraryClient::Setup setup,
                     const PairOptions& options) {
  BurstSender sender(client, std::move(setup), options);
  sender.run(options.duration / 5);  // to warm up
  sender.settle();
  const std::uint64_t delivered_before = sender.delivered();
  const auto begin = Clock::now();
  const ThreeProcesses processes(::getpid(), options.partner, options.hub);
  sender.run(options.duration);
  sender.settle();
  const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  const auto delivered = static_cast<double>(sender.delivered() - delivered_before);
  Findings findings;
  findings.add("messages_per_second", delivered / seconds);
  findings.add("messages", delivered);
  processes.add_to(findings, std::max(1.0, delivered));
  findings.add("lost", static_cast<double>(sender.lost()));
  findings.add("wrong", static_cast<double>(sender.wrong()));
  return findings;
}

void receive_bursts(LibraryClient& client, LibraryClient::Setup setup, const PairOptions& options) {
  Inbox inbox;
  inbox.expect(kData, options.payload_bytes);
  const std::uint64_t report_every = window_of(options.payload_bytes) / kReportsPerWindow;
  std::uint64_t next_report = report_every;
  const auto report = [&](bool is_answer) {
    std::array<std::byte, kReportBytes> message;
    store_u64(message.data(), make_stamp(kReport, is_answer ? 1 : 0));
    store_u64(message.data() + 8, inbox.delivered());
    store_u64(message.data() + 16, inbox.wrong());
    client.send(message);
  };
  client.open(setup, [&](std::span<const std::byte> message) {
    const bool is_question = message.size() == kStampBytes;
    if (!is_question) inbox.on_message(message);
    if (!is_question && inbox.delivered() < next_report) return;
    next_report = inbox.delivered() + report_every;
    report(is_question);
  });
  say_ready();
  for (;;) static_cast<void>(client.wait(Clock::now() + kAskAgain));
}

}  // namespace gimnet::perf
