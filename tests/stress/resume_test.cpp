#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "tests/stress/support/cutting_proxy.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/nif_node.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/statistics.hpp"

// A connection that is cut at random bytes, a hundred times, with resume on: provable is that each
// message arrives once and in order, and that where the buffer is too small for that, the gaps that
// are announced equal what is lost.

namespace gimnet::stress {
namespace {

constexpr std::size_t kCuts = 100;
constexpr std::size_t kPayloadBytes = 100;
constexpr std::int32_t kPatienceMs = 60'000;

std::uint64_t message_count() { return is_full_size() ? 1'000'000 : 100'000; }

// A node that was connected for a keep-alive interval dials again at once; otherwise it waits for
// up to a second.
constexpr std::chrono::milliseconds kLeastLife{20};
const std::vector<std::string> kTwoShards{"--shards", "2", "--limit", "keep_alive_ms=10"};

CutPlan hundred_cuts() {
  CutPlan plan;
  plan.cuts = kCuts;
  // Sooner than evenly spread, so that all of them come before the last message.
  plan.bytes_between = message_count() * (kPayloadBytes + proto::kHeaderSize) / kCuts / 2;
  plan.least_life = kLeastLife;
  return plan;
}

nif_options with_resume() {
  nif_options options{};
  options.resume = NIF_RESUME_ON;
  return options;
}

/// Sends numbered messages to `to`, each of which blocks while it has to.
void send_numbers(const NifNode& from, std::uint32_t to, std::uint64_t count) {
  for (std::uint64_t number = 1; number <= count; ++number) {
    char payload[kPayloadBytes] = {};
    std::memcpy(payload, &number, sizeof number);
    if (nif_send_to(from.get(), to, payload, sizeof payload) != NIF_OK)
      throw std::runtime_error(nif_error_text());
  }
}

struct Received {
  std::uint64_t messages = 0;
  std::uint64_t out_of_order = 0;
  std::uint64_t repeated = 0;
  std::uint64_t skipped = 0;    ///< numbers that did not come
  std::uint64_t announced = 0;  ///< by gaps
  std::uint64_t last = 0;
  bool is_gap_unknown = false;
};

void take(const nif_incoming& in, Received& received) {
  if (in.type == NIF_GAP) {
    received.announced += in.count;
    received.is_gap_unknown = received.is_gap_unknown || in.count == NIF_COUNT_UNKNOWN;
  }
  if (in.type != NIF_MESSAGE) return;
  std::uint64_t number = 0;
  std::memcpy(&number, in.payload, sizeof number);
  ++received.messages;
  if (number == received.last) ++received.repeated;
  if (number < received.last) ++received.out_of_order;
  if (number > received.last) received.skipped += number - received.last - 1;
  received.last = std::max(received.last, number);
}

/// Receives until message number `last` is there.
Received receive_until(const NifNode& node, std::uint64_t last) {
  Received received;
  Incoming in;
  while (received.last < last) {
    const nif_status status = in.receive(node, kPatienceMs);
    if (status != NIF_OK) {
      throw std::runtime_error(std::string(nif_status_text(status)) + " after " +
                               std::to_string(received.messages));
    }
    take(*in.operator->(), received);
  }
  return received;
}

void expect_each_once(const Received& received) {
  EXPECT_EQ(received.messages, message_count());
  EXPECT_EQ(received.out_of_order, 0u);
  EXPECT_EQ(received.repeated, 0u);
  EXPECT_EQ(received.skipped, 0u);
  EXPECT_EQ(received.announced, 0u);
}

void expect_balanced(const HubProcess& hub) {
  RawNode observer(hub.unix_url());
  const Statistics end = wait_for(
      observer, [](const Statistics& now) { return now["queued"] == 0; },
      "confirmation of the last frames");
  EXPECT_TRUE(end.is_balanced()) << end.text();
  EXPECT_EQ(end["accepted"], message_count());
  EXPECT_EQ(end["delivered"], message_count());
  EXPECT_EQ(end.dropped(), 0u) << end.text();
}

TEST(Resume, EachMessageFromTheHubArrivesOnceThroughAHundredCuts) {
  const HubProcess hub(kTwoShards);
  CuttingProxy proxy(hub.tcp_url(), hundred_cuts());
  const NifNode sender(hub.unix_url(), "sender", with_resume());
  const NifNode receiver(proxy.url(), "receiver", with_resume());
  std::thread sending([&] { send_numbers(sender, receiver.id(), message_count()); });
  const Received received = receive_until(receiver, message_count());
  sending.join();
  expect_each_once(received);
  EXPECT_GE(proxy.cuts(), kCuts);
  expect_balanced(hub);
}

TEST(Resume, EachMessageToTheHubArrivesOnceThroughAHundredCuts) {
  const HubProcess hub(kTwoShards);
  CuttingProxy proxy(hub.tcp_url(), hundred_cuts());
  const NifNode sender(proxy.url(), "sender", with_resume());
  const NifNode receiver(hub.unix_url(), "receiver", with_resume());
  std::thread sending([&] { send_numbers(sender, receiver.id(), message_count()); });
  const Received received = receive_until(receiver, message_count());
  sending.join();
  expect_each_once(received);
  EXPECT_GE(proxy.cuts(), kCuts);
  expect_balanced(hub);
}

TEST(Resume, TheAnnouncedGapIsTheLossWhereTheBufferIsSmall) {
  const HubProcess hub({"--shards", "2", "--limit", "resume_bytes=65536"});
  CuttingProxy proxy(hub.tcp_url(), {});
  const NifNode publisher(hub.unix_url(), "publisher");
  const NifNode subscriber(proxy.url(), "subscriber", with_resume());
  std::uint32_t group = 0;
  nif_service service{};
  service.struct_size = sizeof service;
  service.name = "stream";
  ASSERT_EQ(nif_advertise(publisher.get(), &service, &group, nullptr, kPatienceMs), NIF_OK);
  ASSERT_EQ(nif_subscribe(subscriber.get(), "publisher/stream", nullptr, kPatienceMs), NIF_OK);
  RawNode observer(hub.unix_url());
  nif_outgoing message = NIF_OUTGOING_INIT;
  message.kind = NIF_GROUP;
  message.to = group;
  std::uint64_t number = 0;
  char payload[1'000] = {};
  const nif_bytes part{payload, sizeof payload};
  message.parts = &part;
  message.part_count = 1;
  Received received;
  Incoming in;
  for (int round = 0; round < 5; ++round) {
    // Frames written while nothing comes through are unconfirmed: far more than the buffer keeps.
    proxy.hold_downstream(true);
    for (int i = 0; i < 400; ++i) {
      std::memcpy(payload, &++number, sizeof number);
      ASSERT_EQ(nif_send(publisher.get(), &message, kPatienceMs), NIF_OK);
    }
    const std::uint64_t sent = number;
    static_cast<void>(wait_for(
        observer, [&](const Statistics& now) { return now["accepted"] == sent; }, "all sent"));
    proxy.cut_now();
    const std::size_t cuts = proxy.cuts();
    const Deadline deadline;
    while (proxy.cuts() == cuts) {
      deadline.check("the cut");
      wait_readable({}, 1);
    }
    proxy.hold_downstream(false);
    while (received.last < number) {
      ASSERT_EQ(in.receive(subscriber, kPatienceMs), NIF_OK);
      take(*in.operator->(), received);
    }
  }
  const Statistics end =
      wait_for(observer, [](const Statistics& now) { return now["queued"] == 0; }, "confirmation");
  EXPECT_FALSE(received.is_gap_unknown);
  EXPECT_GT(received.announced, 0u) << "nothing was lost: the test is too small";
  EXPECT_EQ(received.out_of_order + received.repeated, 0u);
  EXPECT_EQ(received.announced, received.skipped) << end.text();
  EXPECT_EQ(received.messages + received.skipped, number);
  EXPECT_EQ(end["gap_frames"], received.announced) << end.text();
  EXPECT_EQ(end["delivered"], received.messages) << end.text();
  EXPECT_TRUE(end.is_balanced()) << end.text();
}

}  // namespace
}  // namespace gimnet::stress
