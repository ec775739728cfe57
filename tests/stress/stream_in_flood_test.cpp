#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <cstring>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "proto/control/ns.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// A stream to a reader that another node floods: provable is that a reader that takes its stream
// faster than it comes gets all of it, and that a slower one gets its share. Paces are those of the
// bytes that the reader takes between two messages of the stream, so a slow machine is only slow.

namespace gimnet::stress {
namespace {

constexpr std::size_t kMessageBytes = 2'048;
constexpr std::size_t kFloodBytes = 1'000;
/// Broadcasts between two messages of the stream: many times what the reader takes.
constexpr std::uint64_t kFloodPerMessage = 64;

std::uint64_t message_count() { return is_full_size() ? 20'000 : 2'000; }

/// A node that sends to the reader as fast as the hub lets it, until it is told to end.
class Flood {
 public:
  Flood(const HubProcess& hub, proto::Kind kind, std::uint32_t dst)
      : kind_(kind), dst_(dst), node_(hub.tcp_url(), options()), thread_([this] { run(); }) {}
  ~Flood() { end(); }
  Flood(const Flood&) = delete;
  Flood& operator=(const Flood&) = delete;

  void end() {
    is_over_.store(true);
    if (thread_.joinable()) thread_.join();
  }
  [[nodiscard]] std::uint64_t sent() const { return sent_.load(); }

 private:
  /// As the libraries, it has little under way when PAUSE comes.
  static JoinOptions options() {
    JoinOptions options;
    options.socket = {64 * 1'024, 64 * 1'024};
    return options;
  }
  void run() {
    const std::vector<std::byte> payload(kFloodBytes);
    while (!is_over_.load()) {
      const bool is_free = node_.flush() && !node_.is_paused(kind_, 1, dst_);
      if (is_free) {
        for (std::uint64_t i = 0; i < kFloodPerMessage; ++i)
          node_.put(parts_of(kind_, dst_), payload);
        sent_.fetch_add(kFloodPerMessage);
      } else {
        wait_readable({node_.descriptor()}, 1);
      }
      node_.keep_alive();
      node_.read_some();
      while (node_.next()) {
      }
    }
    node_.flush_all();
  }

  const proto::Kind kind_;
  const std::uint32_t dst_;
  std::atomic<bool> is_over_{false};
  std::atomic<std::uint64_t> sent_{0};
  RawNode node_;
  std::thread thread_;
};

class Reader {
 public:
  explicit Reader(const HubProcess& hub) : node_(hub.tcp_url(), options()) {}

  [[nodiscard]] RawNode& node() { return node_; }
  [[nodiscard]] std::uint64_t received() const { return received_; }

  /// Takes exactly so many bytes.
  void take(std::uint64_t bytes) {
    const Deadline deadline;
    const std::uint64_t end = node_.bytes_read() + bytes;
    while (node_.bytes_read() < end) {
      deadline.check("bytes of a flood");
      if (!node_.read_some(end - node_.bytes_read())) wait_readable({node_.descriptor()}, 100);
      look();
    }
    node_.keep_alive();
  }
  /// Takes what waits. Returns whether the message with that number has come.
  [[nodiscard]] bool take_up_to(std::uint64_t number) {
    if (!node_.read_some()) wait_readable({node_.descriptor()}, 1);
    look();
    node_.keep_alive();
    return last_ == number;
  }

 private:
  static JoinOptions options() {
    JoinOptions options;
    options.socket.receive_buffer_bytes = 64 * 1'024;
    return options;
  }
  void look() {
    while (const auto frame = node_.next()) {
      if (frame->header.kind != proto::Kind::group) continue;
      std::memcpy(&last_, frame->body().data(), sizeof last_);
      received_ += last_ != 0 ? 1 : 0;
    }
  }

  RawNode node_;
  std::uint64_t received_ = 0;
  std::uint64_t last_ = 0;
};

/// Returns how many messages of a stream came to a reader that takes so many bytes between two.
std::uint64_t received_in_flood(proto::Kind kind, std::uint64_t bytes_per_message) {
  const HubProcess hub({"--shards", "2"});
  JoinOptions provider_options;
  provider_options.hello.name = "provider";
  RawNode provider(hub.tcp_url(), provider_options);
  proto::ns::Advertise service;
  service.service = "stream";
  const std::uint32_t group =
      provider.ask<proto::ns::AdvertiseAnswer>(proto::Kind::ns, service).group.value();
  Reader reader(hub);
  static_cast<void>(reader.node().ask<proto::ns::SubscribeAnswer>(
      proto::Kind::ns, proto::ns::Subscribe{"provider/stream"}));

  const bool is_broadcast = kind == proto::Kind::broadcast;
  Flood flood(hub, kind, is_broadcast ? 0xFFFFFFFF : reader.node().id().value());
  std::vector<std::byte> payload(kMessageBytes - proto::kHeaderSize);
  const auto publish = [&](std::uint64_t number) {
    std::memcpy(payload.data(), &number, sizeof number);
    provider.put(parts_of(proto::Kind::group, group), payload);
    provider.flush_all();
  };
  for (std::uint64_t number = 1; number <= message_count(); ++number) {
    const Deadline deadline;
    do {
      deadline.check("a flood");
      provider.keep_alive();
      provider.read_some();
      while (provider.next()) {
      }
    } while (is_broadcast && flood.sent() < kFloodPerMessage * number);
    publish(number);
    reader.take(bytes_per_message);
  }
  flood.end();
  // Waiting messages come before a message that finds room again.
  const Deadline deadline;
  do {
    deadline.check("what waits for the reader");
    publish(0);
  } while (!reader.take_up_to(0));
  return reader.received();
}

TEST(StreamInFlood, AReaderThatKeepsUpLosesNothing) {
  for (const proto::Kind kind : {proto::Kind::unicast, proto::Kind::broadcast}) {
    EXPECT_EQ(received_in_flood(kind, 4 * kMessageBytes), message_count())
        << "kind " << static_cast<int>(kind);
  }
}

// It takes half of the stream's bytes, of which half is the stream's share.
TEST(StreamInFlood, AReaderOfHalfThePaceLosesAtMostATenthMoreThanItsShare) {
  for (const proto::Kind kind : {proto::Kind::unicast, proto::Kind::broadcast}) {
    const std::uint64_t lost = message_count() - received_in_flood(kind, kMessageBytes / 2);
    const std::uint64_t share = message_count() - message_count() / 4;
    EXPECT_LE(lost, share + share / 10) << "kind " << static_cast<int>(kind);
  }
}

}  // namespace
}  // namespace gimnet::stress
