#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hub/control/conductor.hpp"
#include "hub/shard/control_frame.hpp"
#include "proto/control/control_message.hpp"
#include "tests/hub/control/support/fake_shards.hpp"

// Tests name the members that matter and leave the others at their defaults, on purpose.
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"

namespace gimnet::hub {

/// A transport that leads nowhere.
class NoStream final : public net::Stream {
 public:
  net::IoResult receive(std::span<std::byte>) override { return {}; }
  net::IoResult send(std::span<const iovec>) override { return {}; }
  void shut_down() override {}
  [[nodiscard]] std::uint64_t unsent_bytes() const override { return 0; }
  void limit_unsent(std::uint32_t) override {}
  void limit_unacknowledged(std::uint32_t) override {}
  [[nodiscard]] int descriptor() const override { return -1; }
};

/// A conductor with two shards that only write down what they are told, and no clock but `now`.
class TestConductor {
 public:
  static constexpr HubId kHub{7};

  /// A node as its shard knows it.
  struct Node {
    NodeId id;
    ShardIndex shard;
    SessionRef session;
    std::uint32_t attachment = 0;
    proto::Welcome welcome;
  };

  explicit TestConductor(Placement placement = Placement::spread, const HubStart& start = {})
      : conductor(facts(), placement, limits,
                  Conductor::Wiring{shards,
                                    {nodes, groups, quiescence},
                                    readable,
                                    start,
                                    [this](const HubState& state) {
                                      kept.push_back(state);
                                      return keep_error;
                                    },
                                    gauges,
                                    &refusals,
                                    [this] { return read_again ? read_again() : Reloading{}; },
                                    [this](LogLevel level) { noted_level = level; }}) {}

  std::optional<proto::Goodbye> try_join(const proto::Hello& hello) {
    Stranger stranger;
    stranger.rights.administer = may_administer;
    stranger.transport = std::make_unique<NoStream>();
    stranger.peer = PeerInfo{"tcp", "127.0.0.1:5000"};
    stranger.identity = identity;
    return conductor.admit(stranger, hello, {now, 1'000'000'000});
  }
  Node join(const proto::Hello& hello) {
    const auto refusal = try_join(hello);
    EXPECT_FALSE(refusal) << refusal->sentence;
    // Behind it come the paces of what the node is told with it.
    auto last = shards.sent.rbegin();
    while (std::holds_alternative<PaceCommand>(last->command)) ++last;
    const auto* attach = std::get_if<AttachCommand>(&last->command);
    EXPECT_NE(attach, nullptr);
    return Node{attach->node, last->shard, attach->session, attach->attachment, attach->welcome};
  }
  Node join(const std::string& name) {
    proto::Hello hello;
    hello.name = name;
    return join(hello);
  }
  void detach(const Node& node, bool said_by_peer = false, proto::GoodbyeCode code = {},
              std::string sentence = {}) {
    conductor.on_event({node.shard, DetachedEvent{node.session, node.attachment, node.id,
                                                  said_by_peer, code, std::move(sentence)}},
                       now);
  }
  void send_frame(const Node& node, proto::Kind kind, std::span<const std::byte> payload,
                  NodeId dst = {}) {
    conductor.on_event({node.shard, ControlFrameEvent{node.session, node.attachment, node.id,
                                                      control_frame(kind, dst, kHub, payload)}},
                       now);
  }

  /// Asks for something and returns the answer, which is the last thing that the node's shard is
  /// told.
  template <class Answer, class Message>
  Result<Answer, proto::Refusal> ask(const Node& node, const Message& message,
                                     proto::Kind kind = proto::Kind::ns) {
    send_frame(node, kind, proto::encode(message, ++requests));
    const auto* answer = std::get_if<SendControlCommand>(&shards.sent.back().command);
    EXPECT_NE(answer, nullptr);
    EXPECT_EQ(answer->answers, 1u);
    EXPECT_EQ(answer->attachment, node.attachment);
    EXPECT_EQ(answer->session.slot, node.session.slot);
    EXPECT_EQ(proto::split_control(payload_of(*answer))->header.request, requests);
    return proto::decode_answer<Answer>(payload_of(*answer));
  }
  static std::span<const std::byte> payload_of(const SendControlCommand& command) {
    return std::span{command.frame}.subspan(proto::kHeaderSize);
  }
  /// All events of one kind that shards were told to send.
  template <class Event>
  std::vector<Event> events() const {
    std::vector<Event> found;
    for (const auto* command : shards.all<SendControlCommand>()) {
      if (proto::split_control(payload_of(*command))->header.operation != Event::kOperation)
        continue;
      EXPECT_EQ(command->answers, 0u);
      found.push_back(*proto::decode<Event>(payload_of(*command)));
    }
    return found;
  }

  static HubFacts facts() {
    HubFacts result;
    result.id = kHub;
    result.name = "hub-7";
    result.version = "1.2.3";
    result.shards = 2;
    return result;
  }

  bool may_administer = false;  ///< those who join
  ReadAgain read_again;         ///< what RELOAD comes to
  std::optional<LogLevel> noted_level;
  Limits limits;
  NodeTable nodes;
  GroupTable groups;
  Quiescence quiescence{2};
  ShardCounters counters[2];
  const ShardCounters* readable[2] = {&counters[0], &counters[1]};
  SessionGauges sessions[2] = {SessionGauges{8}, SessionGauges{8}};
  const SessionGauges* gauges[2] = {&sessions[0], &sessions[1]};
  RefusalCounters refusals;
  FakeShards shards{2};
  Identity identity = Identity::open();  ///< of those who join
  std::vector<HubState> kept;            ///< what the hub had to keep, in order
  std::string keep_error;                ///< why it cannot
  std::uint16_t requests = 0;
  std::chrono::milliseconds now{1'000};
  Conductor conductor;
};

}  // namespace gimnet::hub
