#include <gtest/gtest.h>

#include <array>
#include <optional>
#include <string>
#include <thread>

#include "client/nif/declarations.hpp"
#include "client/nif/last_messages.hpp"
#include "gimnet/nif_names.h"
#include "proto/frame/report.hpp"
#include "tests/client/nif/support/declaring.hpp"

// Retained services and a hub that forgot their last message.

namespace gimnet::nif::test {
namespace {

TEST(Declarations, GiveAHubThatForgotThemTheLastMessagesBeforeNewerOnes) {
  FakeHub hub;
  for (const std::size_t size : {0u, 3u, 4'097u, 8'192u, 8'193u, 1u << 20}) {
    const std::string last(size, 'm');
    Connected connected = with_map(hub, last);
    come_back(hub, connected, false);
    std::thread publishing(
        [&] { EXPECT_EQ(publish(connected.node.get(), kGroup, "newer"), NIF_OK); });
    answer_advertise(connected.hub, "map", kGroup);
    expect_published(connected.hub, kGroup, last);
    expect_published(connected.hub, kGroup, "newer");
    publishing.join();
  }
}

TEST(Declarations, GiveALargerLastMessageThatTheProgramWantsKept) {
  constexpr std::uint32_t kLarge = 2u << 20;
  FakeHub hub;
  nif_options options = default_options("robot");
  options.last_message_bytes = kLarge;
  Connected connected = connect_to(hub, options, make_welcome(kResumeBytes));
  nif_node* const node = connected.node.get();
  advertise(connected, "map", kGroup, true);
  for (const std::uint32_t beyond : {0u, 1u}) {
    const std::string last(kLarge + beyond, 'm');
    std::thread publishing([&] { EXPECT_EQ(publish(node, kGroup, last), NIF_OK); });
    expect_published(connected.hub, kGroup, last);
    publishing.join();
    EXPECT_EQ(counters_of(node).last_messages_not_kept, beyond);
    come_back(hub, connected, false);
    answer_advertise(connected.hub, "map", kGroup);
    if (beyond == 0) expect_published(connected.hub, kGroup, last);
    EXPECT_EQ(publish(node, kGroup, "newer"), NIF_OK);
    expect_published(connected.hub, kGroup, "newer");
  }
}

TEST(Declarations, SayWhichMessagesOfARetainedServiceTheHubDoesNotKeep) {
  FakeHub hub;
  for (const std::optional<std::uint32_t> most : {std::optional<std::uint32_t>{}, {0u}, {100u}}) {
    proto::Welcome welcome = make_welcome(kResumeBytes);
    welcome.retained_bytes_max = most;
    Connected connected = connect_to(hub, default_options("robot"), welcome);
    nif_node* const node = connected.node.get();
    advertise(connected, "map", kGroup, true);
    for (const std::size_t size : {0u, 1u, 100u, 101u, 10'000u}) {
      const nif_status expected = most && size > *most ? NIF_NOT_RETAINED : NIF_OK;
      const std::string payload(size, 'm');
      EXPECT_EQ(publish(node, kGroup, payload), expected) << size;
      if (size != 0) expect_published(connected.hub, kGroup, payload);
    }
    EXPECT_EQ(publish(node, 99, std::string(101, 'x')), NIF_OK) << "of no retained service";
    EXPECT_EQ(counters_of(node).messages_sent, 6u);
  }
}

TEST(Declarations, GiveOutReportsOfWhatIsNotKeptWithoutBeingAsked) {
  FakeHub hub;
  Connected connected = connect_to(hub, default_options("robot"), make_welcome());
  advertise(connected, "map", kGroup, true);
  for (const std::size_t size : {3u, 5'000u}) {
    const std::string payload = pattern(size);
    ASSERT_EQ(publish(connected.node.get(), kGroup, payload), NIF_OK);
    const auto frame = connected.hub.next_message();
    ASSERT_TRUE(frame);
    std::array<std::byte, proto::kReportSizeMax> report;
    const std::size_t bytes =
        proto::encode_report({proto::DropReason::not_retained, 1, frame->header,
                              std::span(frame->bytes).subspan(proto::kHeaderSize)},
                             report);
    proto::FrameParts parts;
    parts.header.kind = proto::Kind::report;
    parts.header.src = kHubNode;
    parts.header.dst = kOwnId;
    connected.hub.send(parts, {reinterpret_cast<const char*>(report.data()), bytes});
    nif_incoming in{};
    ASSERT_EQ(nif_receive(connected.node.get(), &in, NIF_FOREVER), NIF_OK);
    EXPECT_EQ(in.type, static_cast<std::uint32_t>(NIF_REPORT));
    EXPECT_EQ(in.reason, static_cast<std::uint32_t>(NIF_DROP_NOT_RETAINED));
    EXPECT_EQ(in.to, kGroup);
    EXPECT_EQ(in.kind, static_cast<std::uint8_t>(NIF_GROUP));
    const std::string said(static_cast<const char*>(in.payload), in.size);
    EXPECT_EQ(said.substr(proto::kHeaderSize, 3), payload.substr(0, 3)) << "how it began";
    nif_release(&in);
  }
}

TEST(Declarations, GiveTheLastMessageToAnotherGroup) {
  FakeHub hub;
  Connected connected = with_map(hub, "map");
  come_back(hub, connected, false);
  answer_advertise(connected.hub, "map", 99);
  expect_published(connected.hub, 99, "map");
  EXPECT_EQ(publish(connected.node.get(), 99, "newer"), NIF_OK);
  expect_published(connected.hub, 99, "newer");
  come_back(hub, connected, false);
  answer_advertise(connected.hub, "map", 99);
  expect_published(connected.hub, 99, "newer");
}

TEST(Declarations, KeepTheLastMessageWhileAHubRefusesTheService) {
  FakeHub hub;
  Connected connected = with_map(hub, "map");
  come_back(hub, connected, false);
  answer_advertise(connected.hub, "map", 0);
  come_back(hub, connected, false);
  answer_advertise(connected.hub, "map", kGroup);
  expect_published(connected.hub, kGroup, "map");
}

TEST(Declarations, GiveNothingAgainToAHubThatHasIt) {
  FakeHub hub;
  Connected connected = with_map(hub, "map");
  connected.hub.send(proto::flow::Confirm{2});
  come_back(hub, connected, true, 2);
  answer_advertise(connected.hub, "map", kGroup);
  EXPECT_EQ(publish(connected.node.get(), kGroup, "newer"), NIF_OK);
  expect_published(connected.hub, kGroup, "newer");
}

TEST(Declarations, GiveNothingAgainOfAServiceThatIsNotRetained) {
  FakeHub hub;
  Connected connected = with_map(hub, "odom", false);
  come_back(hub, connected, false);
  answer_advertise(connected.hub, "map", kGroup);
  EXPECT_EQ(publish(connected.node.get(), kGroup, "newer"), NIF_OK);
  expect_published(connected.hub, kGroup, "newer");
}

TEST(Declarations, ForgetTheLastMessageOfAServiceThatIsAnotherStreamNow) {
  FakeHub hub;
  Connected connected = with_map(hub, "map");
  advertise(connected, "map", 12, true, 7);
  come_back(hub, connected, false);
  answer_advertise(connected.hub, "map", 12);
  EXPECT_EQ(publish(connected.node.get(), 12, "newer"), NIF_OK);
  expect_published(connected.hub, 12, "newer");
}

/// The program advertises once more while the library declares again, and hears of it first.
TEST(Declarations, GiveTheLastMessageOfAServiceThatIsAdvertisedOnceMoreMeanwhile) {
  for (const std::uint32_t group : {kGroup, 99u}) {
    FakeHub hub;
    Connected connected = with_map(hub, "map");
    come_back(hub, connected, false);
    std::uint16_t number = 0;
    ASSERT_TRUE(connected.hub.next_request<proto::ns::Advertise>(number));
    advertise(connected, "map", group, true);
    connected.hub.send_control(
        proto::Kind::ns,
        proto::encode_answer(proto::ns::AdvertiseAnswer{GroupId{group}, 0}, number));
    expect_published(connected.hub, group, "map");
  }
}

/// A message that is being sent is about to be the last one.
TEST(Declarations, PutNothingBetweenTheFragmentsOfANewerMessage) {
  FakeHub hub;
  nif_options options = default_options("robot");
  options.resume_bytes = 64 * 1024;
  Connected connected = connect_to(hub, options, make_welcome(kResumeBytes));
  nif_node* const node = connected.node.get();
  advertise(connected, "map", kGroup, true);
  ASSERT_EQ(publish(node, kGroup, "map"), NIF_OK);
  ASSERT_EQ(nif_send_to(node, kPeerId, "x", 1), NIF_OK);
  const std::string newer(256 * 1024, 'n');
  std::thread publishing([&] { EXPECT_EQ(publish(node, kGroup, newer), NIF_OK); });
  // It lets what the hub did not confirm go, down to the message to one node, and waits.
  while (counters_of(node).frames_let_go == 0) std::this_thread::yield();
  expect_published(connected.hub, kGroup, "map");
  ASSERT_TRUE(connected.hub.next_message());
  ASSERT_TRUE(connected.hub.next_message()) << "the first fragment";
  come_back(hub, connected, true);
  std::uint64_t frames = counters_of(node).frames_let_go;
  std::string received;
  while (received.size() < newer.size()) {
    const auto frame = connected.hub.next_message();
    ASSERT_TRUE(frame);
    if (frame->header.kind == proto::Kind::ns) {
      const auto number = proto::split_control(frame->view().payload)->header.request;
      connected.hub.send_control(
          proto::Kind::ns,
          proto::encode_answer(proto::ns::AdvertiseAnswer{GroupId{kGroup}, 0}, number));
      continue;
    }
    connected.hub.send(proto::flow::Confirm{++frames});
    if (frame->header.kind == proto::Kind::group) received += frame->payload();
  }
  publishing.join();
  EXPECT_TRUE(received == newer) << "an older message came between";
}

}  // namespace
}  // namespace gimnet::nif::test
