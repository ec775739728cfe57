#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <deque>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "proto/control/ns.hpp"
#include "proto/frame/reassembler.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// A reader of 1 MB/s behind senders of far more: provable is how many bytes come before what
// matters, counted where the reader reads them, from the moment at which the sender has given it to
// its kernel.

namespace gimnet::stress {
namespace {

constexpr std::uint64_t kReadBytesPerS = 1'000'000;
constexpr std::size_t kBulkPayload = 8'000;
constexpr std::uint64_t kBulkBeforeUrgentMax = 256 * 1'024;

JoinOptions at_shard(std::uint16_t shard, const char* name = "") {
  JoinOptions options;
  options.hello.name = name;
  options.hello.shard = shard;
  return options;
}

JoinOptions reader_options() {
  JoinOptions options = at_shard(0);
  options.socket.receive_buffer_bytes = 64 * 1'024;
  return options;
}

/// A node that takes kReadBytesPerS and no more.
class Reader {
 public:
  explicit Reader(const HubProcess& hub) : node_(hub.tcp_url(), reader_options()) {}

  /// Reads what it may by now, and gives every frame with its position in the stream to `take`.
  void turn(const std::function<void(const Frame&, std::uint64_t position)>& take) {
    const auto passed =
        std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - begun_).count();
    const std::uint64_t allowed = static_cast<std::uint64_t>(passed) * kReadBytesPerS / 1'000;
    node_.keep_alive();
    if (allowed > node_.bytes_read()) node_.read_some(allowed - node_.bytes_read());
    while (const auto frame = node_.next()) take(*frame, node_.position());
  }

  [[nodiscard]] RawNode& node() { return node_; }
  [[nodiscard]] const RawNode& node() const { return node_; }

 private:
  RawNode node_;
  const Clock::time_point begun_ = Clock::now();
};

std::vector<std::string> two_shards() { return {"--shards", "2", "--placement", "hint"}; }

// ---- real-time messages behind bulk

class BulkScene {
 public:
  explicit BulkScene(const HubProcess& hub) : reader_(hub), bulk_(hub.unix_url(), at_shard(0)) {
    for (std::uint16_t shard = 0; shard < 2; ++shard)
      urgent_.emplace_back(hub.unix_url(), at_shard(shard));
  }

  /// Until so many real-time messages from each shard have arrived, while bulk waits all the time.
  void run(std::size_t messages) {
    const Deadline deadline;
    for (std::uint64_t number = 0; number < 2 * messages; ++number) {
      send_urgent(number);
      while (arrived_ <= number) {
        deadline.check("a real-time message");
        turn();
      }
      // Some bulk between two of them, so that each finds the queues as they are when nothing
      // urgent comes.
      const std::uint64_t enough = reader_.node().bytes_read() + 100'000;
      while (reader_.node().bytes_read() < enough) {
        deadline.check("bulk");
        turn();
      }
    }
  }

  void fill() {
    const Deadline deadline;
    while (bulk_.pauses() == 0) {
      deadline.check("PAUSE: the hub's queue is full");
      turn();
    }
  }

  [[nodiscard]] std::uint64_t most_before(std::size_t shard) const {
    return most_before_.at(shard);
  }

 private:
  void send_urgent(std::uint64_t number) {
    RawNode& node = urgent_[number % 2];
    node.put(parts_of(proto::Kind::unicast, reader_.node().id().value(),
                      proto::Policy::kind_default, proto::Lane::real_time),
             std::as_bytes(std::span(&number, 1)));
    node.flush_all();
    sent_at_ = reader_.node().bytes_read();
  }

  void turn() {
    const std::uint32_t reader = reader_.node().id().value();
    const bool is_paused = bulk_.is_paused(proto::Kind::unicast, 2, reader);
    // As much as the hub takes, however long it lasts: bulk waits before each of the real-time
    // messages.
    if (!is_paused && bulk_.unwritten() == 0) {
      const std::vector<std::byte> payload(kBulkPayload);
      bulk_.put(parts_of(proto::Kind::unicast, reader, proto::Policy::block, proto::Lane::bulk),
                payload);
    }
    bulk_.flush();
    for (RawNode* node : {&bulk_, &urgent_[0], &urgent_[1]}) {
      node->keep_alive();
      node->read_some();
      while (node->next()) {
      }
    }
    reader_.turn([&](const Frame& frame, std::uint64_t position) {
      if (frame.header.lane != 0 || frame.header.kind != proto::Kind::unicast) return;
      std::uint64_t& most = most_before_[arrived_++ % 2];
      const std::uint64_t begin = position - frame.bytes.size();
      most = std::max(most, begin - std::min(begin, sent_at_));
    });
    if (is_paused) wait_readable({bulk_.descriptor()}, 1);
  }

  Reader reader_;
  RawNode bulk_;
  std::deque<RawNode> urgent_;
  std::uint64_t sent_at_ = 0;
  std::uint64_t arrived_ = 0;
  std::array<std::uint64_t, 2> most_before_{};
};

TEST(Freshness, ARealTimeMessageIsPrecededByLittleBulk) {
  const HubProcess hub(two_shards());
  BulkScene scene(hub);
  scene.fill();
  scene.run(is_full_size() ? 40 : 15);
  EXPECT_LE(scene.most_before(0), kBulkBeforeUrgentMax) << "from the reader's shard";
  EXPECT_LE(scene.most_before(1), kBulkBeforeUrgentMax) << "from another shard";
  RecordProperty("bytes_before_same_shard", static_cast<int>(scene.most_before(0)));
  RecordProperty("bytes_before_other_shard", static_cast<int>(scene.most_before(1)));
}

// ---- LATEST

constexpr std::size_t kLatestBytes = 200'000;
constexpr std::size_t kFragmentBytes = 8'000;
constexpr std::chrono::milliseconds kPublishEvery{10};

class LatestScene {
 public:
  LatestScene(const HubProcess& hub, std::uint16_t publisher_shard)
      : reader_(hub), publisher_(hub.unix_url(), at_shard(publisher_shard, "publisher")) {
    proto::ns::Advertise service;
    service.service = "scan";
    service.delivery = proto::ns::Delivery::latest;
    group_ = publisher_.ask<proto::ns::AdvertiseAnswer>(proto::Kind::ns, service).group.value();
    static_cast<void>(reader_.node().ask<proto::ns::SubscribeAnswer>(
        proto::Kind::ns, proto::ns::Subscribe{"publisher/scan"}));
  }

  void run(std::size_t messages) {
    const Deadline deadline;
    Clock::time_point next = Clock::now();
    while (ages_.size() < messages) {
      deadline.check("messages of the latest delivery");
      if (Clock::now() >= next) {
        next += kPublishEvery;
        publish();
      }
      publisher_.flush();
      publisher_.read_some();
      while (publisher_.next()) {
      }
      reader_.turn([&](const Frame& frame, std::uint64_t position) { take(frame, position); });
      wait_readable({}, 1);
    }
  }

  [[nodiscard]] std::uint64_t highest_age_bytes() const {
    return *std::max_element(ages_.begin(), ages_.end());
  }
  [[nodiscard]] std::uint64_t published() const { return published_; }
  /// Frames.
  [[nodiscard]] std::uint64_t sent() const { return publisher_.frames_sent(); }
  [[nodiscard]] std::uint64_t received() const { return reader_.node().frames_got(); }
  [[nodiscard]] bool is_whole_and_newer() const { return is_whole_and_newer_; }
  [[nodiscard]] std::uint64_t lost() const { return reassembler_.lost_messages(); }
  [[nodiscard]] std::string ages_text() const {
    std::string text;
    for (const std::uint64_t age : ages_) text += std::to_string(age) + " ";
    return text;
  }

 private:
  void publish() {
    ++published_;
    const std::vector<std::uint64_t> words(kFragmentBytes / sizeof(std::uint64_t), published_);
    for (std::uint32_t offset = 0; offset < kLatestBytes; offset += kFragmentBytes) {
      auto parts = parts_of(proto::Kind::group, group_, proto::Policy::latest);
      parts.fragment =
          proto::FragmentHeader{static_cast<std::uint32_t>(published_), offset, kLatestBytes};
      publisher_.put(parts, std::as_bytes(std::span(words)));
    }
    publisher_.flush_all();
    published_at_[published_] = reader_.node().bytes_read();
  }

  void take(const Frame& frame, std::uint64_t position) {
    const auto view = proto::parse_frame(frame.bytes, proto::Origin::hub);
    if (!view || !view->fragment) return;
    const auto result =
        reassembler_.take(proto::FragmentStream::of(view->header), *view->fragment, view->payload);
    if (result.state != proto::Reassembled::State::whole) return;
    std::vector<std::uint64_t> words(result.message.size() / sizeof(std::uint64_t));
    std::memcpy(words.data(), result.message.data(), result.message.size());
    const std::uint64_t number = words.front();
    const bool is_whole =
        result.message.size() == kLatestBytes &&
        std::all_of(words.begin(), words.end(), [&](std::uint64_t word) { return word == number; });
    is_whole_and_newer_ = is_whole_and_newer_ && is_whole && number > last_;
    last_ = number;
    ages_.push_back(position - published_at_[number]);
  }

  Reader reader_;
  RawNode publisher_;
  std::uint32_t group_ = 0;
  proto::Reassembler reassembler_;
  std::uint64_t published_ = 0;
  std::map<std::uint64_t, std::uint64_t>
      published_at_;                 ///< number, and what the reader had read by then
  std::vector<std::uint64_t> ages_;  ///< bytes read from publication to the last byte
  std::uint64_t last_ = 0;
  bool is_whole_and_newer_ = true;
};

void expect_fresh(std::uint16_t publisher_shard) {
  const HubProcess hub(two_shards());
  LatestScene scene(hub, publisher_shard);
  scene.run(is_full_size() ? 60 : 20);
  EXPECT_TRUE(scene.is_whole_and_newer());
  EXPECT_EQ(scene.lost(), 0u);
  EXPECT_LE(scene.highest_age_bytes(), 2 * kLatestBytes) << scene.ages_text();
  ::testing::Test::RecordProperty("ages", scene.ages_text());
  EXPECT_GT(scene.published(), 100u);
  RawNode observer(hub.unix_url());
  const Statistics end = wait_for(
      observer, [&](const Statistics& now) { return now["accepted"] == scene.sent(); },
      "all that was published");
  EXPECT_EQ(end["copies"], 0u);
  EXPECT_GE(end["delivered"], scene.received());
}

TEST(Freshness, LatestIsWholeAndYoungFromTheSameShard) { expect_fresh(0); }

TEST(Freshness, LatestIsWholeAndYoungFromAnotherShard) { expect_fresh(1); }

}  // namespace
}  // namespace gimnet::stress
