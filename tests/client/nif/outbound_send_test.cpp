#include <gtest/gtest.h>

#include <array>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "base/endian.hpp"
#include "client/nif/outbound.hpp"
#include "proto/frame/report.hpp"
#include "tests/client/nif/support/fake_hub.hpp"

// Tests the view of a sender: order, pauses, fragments and windows, time limits.

namespace gimnet::nif::test {
namespace {

nif_status send(nif_node* node, std::uint32_t to, std::string_view payload,
                std::int32_t timeout_ms = NIF_FOREVER, std::uint8_t lane = NIF_NORMAL) {
  const nif_bytes part = {payload.data(), payload.size()};
  nif_outgoing message = NIF_OUTGOING_INIT;
  message.to = to;
  message.lane = lane;
  message.parts = &part;
  message.part_count = 1;
  return nif_send(node, &message, timeout_ms);
}

/// A round trip: whatever the hub said before has been taken by the library.
void settle(Connected& connected) {
  connected.hub.send(proto::flow::Ping{77, 1});
  while (const auto pong = connected.hub.next_flow<proto::flow::Pong>()) {
    if (pong->sequence == 77) return;
  }
  ADD_FAILURE() << "no PONG";
}

constexpr std::uint32_t kSlow = (7u << 20) | 100;
constexpr std::uint32_t kFast = (7u << 20) | 101;

TEST(OutboundSend, APauseHoldsItsDestinationAndNothingElse) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  connected.hub.send(proto::flow::Pause{{proto::Kind::unicast, proto::Lane::normal, kSlow}});
  settle(connected);
  EXPECT_EQ(send(node, kSlow, "held", 0), NIF_TIMEOUT);
  EXPECT_EQ(send(node, kFast, "fast", 0), NIF_OK);
  EXPECT_EQ(send(node, kSlow, "other lane", 0, NIF_REAL_TIME), NIF_OK);
  std::thread waiting([node] { EXPECT_EQ(send(node, kSlow, "held"), NIF_OK); });
  // Lanes may overtake each other.
  const std::set<std::string> both{connected.hub.next_message()->payload(),
                                   connected.hub.next_message()->payload()};
  EXPECT_EQ(both, (std::set<std::string>{"fast", "other lane"}));
  EXPECT_EQ(send(node, kFast, "still fast", 0), NIF_OK);
  EXPECT_EQ(connected.hub.next_message()->payload(), "still fast");
  connected.hub.send(proto::flow::Resume{{proto::Kind::unicast, proto::Lane::normal, kSlow}});
  EXPECT_EQ(connected.hub.next_message()->payload(), "held");
  waiting.join();
  EXPECT_EQ(counters_of(node).pauses, 1u);
}

TEST(OutboundSend, ReceivesAndKeepsAliveWhileASendWaits) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  connected.hub.send(proto::flow::Pause{{proto::Kind::unicast, proto::Lane::normal, kSlow}});
  settle(connected);
  std::thread waiting([node] { EXPECT_EQ(send(node, kSlow, "held"), NIF_CLOSED); });
  connected.hub.send_unicast(kPeerId, kOwnId, "meanwhile");
  nif_incoming in;
  ASSERT_EQ(nif_receive(node, &in, NIF_FOREVER), NIF_OK);
  EXPECT_EQ(payload_of(in), "meanwhile");
  nif_release(&in);
  EXPECT_TRUE(connected.hub.next_flow<proto::flow::Ping>());
  EXPECT_EQ(nif_close(connected.node.release()), NIF_OK);
  waiting.join();
}

TEST(OutboundSend, EverySizeArrivesWhole) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  for (const std::size_t size : {0u, 1u, 15u, 16u, 17u, 4'095u, 4'096u, 4'097u, 8'191u, 8'192u,
                                 8'193u, 32'767u, 32'768u, 32'769u, 65'519u, 65'537u, 200'000u}) {
    const std::string payload = pattern(size);
    std::thread sending([&] { EXPECT_EQ(send(connected.node.get(), kPeerId, payload), NIF_OK); });
    std::string received;
    std::optional<std::uint32_t> number;
    do {
      const auto frame = connected.hub.next_message();
      ASSERT_TRUE(frame);
      const auto view = frame->view();
      EXPECT_EQ(view.fragment.has_value(), size > 4'096) << size;
      if (view.fragment) {
        EXPECT_EQ(view.fragment->offset, received.size());
        EXPECT_EQ(view.fragment->total, size);
        EXPECT_EQ(view.fragment->message, number.value_or(view.fragment->message));
        number = view.fragment->message;
      }
      EXPECT_TRUE(size > 8'192 || view.payload.size() == size) << "up to 8 KiB in one frame";
      received += frame->payload();
    } while (received.size() < size);
    sending.join();
    EXPECT_TRUE(received == payload) << size;
  }
}

TEST(OutboundSend, ALargeMessageWaitsForItsWindowAndHoldsUpNobody) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  nif_node* const node = connected.node.get();
  const std::string payload = pattern(3u << 20);
  std::thread sending([&] { EXPECT_EQ(send(node, kSlow, payload), NIF_OK); });
  std::string received;
  proto::ReceiveWindow window(1, static_cast<std::uint32_t>(payload.size()));
  while (received.size() < proto::kWindowDefault)
    received += connected.hub.next_message()->payload();
  EXPECT_EQ(received.size(), proto::kWindowDefault) << "not a byte more before the first TAKEN";
  EXPECT_EQ(send(node, kFast, "quick"), NIF_OK);
  EXPECT_EQ(send(node, kSlow, "another in the same stream", 0), NIF_TIMEOUT);
  EXPECT_EQ(connected.hub.next_message()->payload(), "quick");
  std::uint32_t number = 0;
  while (received.size() < payload.size()) {
    std::array<std::byte, proto::kTakenSize> taken;
    const auto size = static_cast<std::uint32_t>(received.size());
    proto::encode_taken({1, size, size + 100'000}, taken);
    proto::FrameParts parts;
    parts.header.kind = proto::Kind::taken;
    parts.header.src = kSlow;
    parts.header.dst = kOwnId;
    connected.hub.send(parts, {reinterpret_cast<const char*>(taken.data()), taken.size()});
    const std::size_t allowed = std::min<std::size_t>(size + 100'000, payload.size());
    while (received.size() < allowed) {
      const auto frame = connected.hub.next_message();
      ASSERT_TRUE(frame);
      number = frame->view().fragment->message;
      received += frame->payload();
    }
    ASSERT_EQ(received.size(), allowed);
  }
  sending.join();
  EXPECT_EQ(number, 1u);
  EXPECT_TRUE(received == payload);
}

void send_taken(Connected& connected, const proto::Taken& taken) {
  std::array<std::byte, proto::kTakenSize> bytes;
  proto::encode_taken(taken, bytes);
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::taken;
  parts.header.src = kSlow;
  parts.header.dst = kOwnId;
  connected.hub.send(parts, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

void read_window(Connected& connected) {
  std::size_t received = 0;
  while (received < proto::kWindowDefault) {
    const auto frame = connected.hub.next_message();
    ASSERT_TRUE(frame);
    received += frame->payload().size();
  }
}

TEST(OutboundSend, GivesUpWhatTheReceiverRefuses) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  const std::string payload = pattern(2u << 20);
  std::thread sending(
      [&] { EXPECT_EQ(send(connected.node.get(), kSlow, payload), NIF_TOO_LARGE); });
  read_window(connected);
  send_taken(connected, {1, 0, 0});
  sending.join();
  EXPECT_EQ(send(connected.node.get(), kSlow, "next", 0), NIF_OK);
}

TEST(OutboundSend, GivesUpWhatTheReceiverLost) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  const std::string payload = pattern(3u << 20);
  std::thread sending(
      [&] { EXPECT_EQ(send(connected.node.get(), kSlow, payload), NIF_NOT_DELIVERED); });
  read_window(connected);
  send_taken(connected, {1, 1000, 1u << 20});
  send_taken(connected, {1, 0, 0});
  sending.join();
}

TEST(OutboundSend, AsksAfterAReceiverThatIsSilentAndBelievesTheReport) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  const std::string payload = pattern(2u << 20);
  std::thread sending(
      [&] { EXPECT_EQ(send(connected.node.get(), kSlow, payload), NIF_NOT_DELIVERED); });
  read_window(connected);
  const auto probe = connected.hub.next_message();
  ASSERT_TRUE(probe);
  EXPECT_EQ(probe->header.kind, proto::Kind::taken);
  EXPECT_TRUE(probe->header.has(proto::kFlagReport));
  std::array<std::byte, proto::kReportSizeMax> report;
  const std::size_t size =
      proto::encode_report({proto::DropReason::no_such_node, 1, probe->header, {}}, report);
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::report;
  parts.header.src = kHubNode;
  parts.header.dst = kOwnId;
  connected.hub.send(parts, {reinterpret_cast<const char*>(report.data()), size});
  sending.join();
  nif_incoming in;
  EXPECT_EQ(nif_receive(connected.node.get(), &in, 0), NIF_TIMEOUT)
      << "nobody asked for this report";
}

/// Has the hub report that frame, or the same piece of another message.
void report(FakeConnection& hub, proto::DropReason reason, const Frame& frame,
            std::uint32_t number_offset = 0) {
  std::vector<std::byte> following(frame.bytes.begin() + proto::kHeaderSize, frame.bytes.end());
  store_le(following.data(), load_le<std::uint32_t>(following.data()) + number_offset);
  std::array<std::byte, proto::kReportSizeMax> payload;
  const std::size_t size = proto::encode_report({reason, 1, frame.header, following}, payload);
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::report;
  parts.header.src = kHubNode;
  parts.header.dst = kOwnId;
  hub.send(parts, {reinterpret_cast<const char*>(payload.data()), size});
}

TEST(OutboundSend, AReportEndsTheLargeMessageThatItIsAbout) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  const std::string payload = pattern(3u << 20);
  std::thread sending([&] {
    EXPECT_EQ(send(connected.node.get(), kSlow, payload), NIF_NOT_DELIVERED);
    EXPECT_NE(std::string(nif_error_text()).find("queue_full"), std::string::npos)
        << nif_error_text();
  });
  std::optional<Frame> frame;
  for (std::size_t size = 0; size < proto::kWindowDefault; size += frame->payload().size()) {
    frame = connected.hub.next_message();
    ASSERT_TRUE(frame);
  }
  report(connected.hub, proto::DropReason::timed_out, *frame, 1);  // one that was sent before, say
  report(connected.hub, proto::DropReason::queue_full, *frame);
  report(connected.hub, proto::DropReason::cut_message, *frame);
  sending.join();
}

/// The message was refused in the middle, and then comes a REPORT of a fragment of it.
bool program_gets_late_report(bool wanted, std::uint32_t age_ms_max, bool other_wanted = false) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options(), make_welcome());
  if (other_wanted) {
    nif_outgoing other = NIF_OUTGOING_INIT;
    other.to = kFast;
    other.flags = NIF_FLAG_REPORT;
    EXPECT_EQ(nif_send(connected.node.get(), &other, NIF_FOREVER), NIF_OK);
    EXPECT_TRUE(connected.hub.next_message());
  }
  const std::string payload = pattern(2u << 20);
  std::thread sending([&] {
    const nif_bytes part = {payload.data(), payload.size()};
    nif_outgoing message = NIF_OUTGOING_INIT;
    message.to = kSlow;
    message.flags = wanted ? NIF_FLAG_REPORT : 0;
    message.age_ms_max = age_ms_max;
    message.parts = &part;
    message.part_count = 1;
    EXPECT_EQ(nif_send(connected.node.get(), &message, NIF_FOREVER), NIF_TOO_LARGE);
  });
  const auto frame = connected.hub.next_message();
  EXPECT_TRUE(frame);
  send_taken(connected, {1, 0, 0});
  sending.join();
  report(connected.hub, proto::DropReason::queue_full, *frame);
  settle(connected);
  settle(connected);  // what one read brings is handed out when all of it is taken, behind the
                      // first PONG
  nif_incoming in{};
  const bool came = nif_receive(connected.node.get(), &in, 0) == NIF_OK;
  EXPECT_TRUE(!came || in.type == NIF_REPORT);
  nif_release(&in);
  return came;
}

TEST(OutboundSend, ALateReportIsForProgramsThatAskedForReports) {
  EXPECT_FALSE(program_gets_late_report(false, 0));
  EXPECT_TRUE(program_gets_late_report(true, 0));
  // An extension stands where the number of the message would.
  EXPECT_FALSE(program_gets_late_report(false, 60'000));
  EXPECT_TRUE(program_gets_late_report(true, 60'000));
  EXPECT_TRUE(program_gets_late_report(false, 0, true))
      << "it may stand for others: a hub merges those of one reason";
}

TEST(OutboundSend, AHubThatDoesNotReadFillsTheQueueAndTimesOut) {
  FakeHub hub;
  nif_options options = default_options();
  options.send_queue_bytes = 64 * 1024;
  Connected connected = connect_to(hub, options, make_welcome());
  const std::string payload = pattern(8'000);
  // Which send is the first to wait is the kernel's matter: it may take more while the queue stands
  // full.
  int sent = 0;
  nif_status status = NIF_OK;
  while ((status = send(connected.node.get(), kPeerId, payload, 1)) == NIF_OK) ++sent;
  EXPECT_EQ(status, NIF_TIMEOUT);
  EXPECT_LE(counters_of(connected.node.get()).send_queue_bytes, 64u * 1024 + 64)
      << "a PING may wait, too";
  for (int i = 0; i < sent; ++i) ASSERT_TRUE(connected.hub.next_message()) << i << " of " << sent;
}

}  // namespace
}  // namespace gimnet::nif::test
