#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/nif_node.hpp"
#include "tests/stress/support/raw_node.hpp"
#include "tests/stress/support/size.hpp"
#include "tests/stress/support/statistics.hpp"

// Large messages from library to library: provable is that every byte arrives, through one shard
// and through two.

namespace gimnet::stress {
namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;
constexpr std::int32_t kPatienceMs = 60'000;

/// Bytes of which each eight say where they are.
std::vector<std::uint64_t> pattern(std::size_t bytes) {
  std::vector<std::uint64_t> words(bytes / sizeof(std::uint64_t));
  std::uint64_t word = bytes;
  for (std::uint64_t& each : words)
    each = word = word * 6'364'136'223'846'793'005u + 1'442'695'040'888'963'407u;
  return words;
}

/// The receiver's library speaks to the sender's in lane 0: when this word has come, so have those,
/// and the sender may go without frames to it being dropped.
void expect_last_word(const NifNode& from, const NifNode& to) {
  nif_outgoing word = NIF_OUTGOING_INIT;
  word.to = to.id();
  word.lane = NIF_REAL_TIME;
  ASSERT_EQ(nif_send(from.get(), &word, kPatienceMs), NIF_OK);
  Incoming in;
  ASSERT_EQ(in.receive(to, kPatienceMs), NIF_OK);
}

void expect_arrives(const HubProcess& hub, std::size_t bytes) {
  const std::vector<std::uint64_t> sent = pattern(bytes);
  nif_options options{};
  options.message_bytes_max = bytes;
  options.shard_plus_one = 2;
  const NifNode receiver(hub.tcp_url(), "receiver", options);
  options.shard_plus_one = 1;
  const NifNode sender(hub.unix_url(), "sender", options);
  nif_status status = NIF_OK;
  std::string error;
  std::thread sending([&] {
    status = nif_send_to(sender.get(), receiver.id(), sent.data(), bytes);
    if (status != NIF_OK) error = nif_error_text();
  });
  Incoming in;
  const nif_status received = in.receive(receiver, kPatienceMs);
  sending.join();
  ASSERT_EQ(status, NIF_OK) << error;
  ASSERT_EQ(received, NIF_OK);
  ASSERT_EQ(in->type, static_cast<std::uint32_t>(NIF_MESSAGE)) << in->text;
  ASSERT_EQ(in->size, bytes);
  EXPECT_EQ(in->from, sender.id());
  EXPECT_EQ(std::memcmp(in->payload, sent.data(), bytes), 0);
  EXPECT_EQ(receiver.counters().messages_lost, 0u);
  expect_last_word(receiver, sender);
}

void expect_all_arrive(const std::vector<std::string>& arguments) {
  const HubProcess hub(arguments);
  std::vector<std::size_t> sizes{kMiB, 16 * kMiB, 64 * kMiB};
  if (is_full_size()) sizes.push_back(1'024 * kMiB);
  for (const std::size_t bytes : sizes) {
    SCOPED_TRACE(bytes);
    expect_arrives(hub, bytes);
  }
  RawNode observer(hub.unix_url());
  const Statistics end =
      wait_for(observer, [](const Statistics& now) { return now["queued"] == 0; }, "the end");
  EXPECT_TRUE(end.is_balanced()) << end.text();
  EXPECT_EQ(end.dropped(), 0u) << end.text();
}

TEST(Sizes, LargeMessagesArriveThroughOneShard) { expect_all_arrive({"--shards", "1"}); }

TEST(Sizes, LargeMessagesArriveThroughTwoShards) {
  expect_all_arrive({"--shards", "2", "--placement", "hint"});
}

}  // namespace
}  // namespace gimnet::stress
