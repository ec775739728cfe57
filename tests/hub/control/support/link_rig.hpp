#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hub/control/links.hpp"
#include "hub/control/network_overview.hpp"
#include "hub/shard/control_frame.hpp"
#include "tests/hub/control/support/fake_shards.hpp"
#include "tests/hub/control/support/test_conductor.hpp"

namespace gimnet::hub {

/// The links of one hub, with a shard that writes down what it is told, and no clock but `now`.
struct LinkRig {
  struct Dialled {
    LinkNumber link;
    proto::Hello hello;
  };
  LinkRig(std::uint16_t id, LinksOptions options, std::uint64_t instance = 0,
          bool configured = true)
      : facts(facts_of(id, instance, configured)),
        links(std::move(options),
              {facts, limits, shards, slots, routes, names, groups,
               [this](LinkNumber link, const DialledLink&, const proto::Hello& hello) {
                 dialled.push_back({link, hello});
               },
               [this] { return ++random; }}) {}

  static HubFacts facts_of(std::uint16_t id, std::uint64_t instance, bool configured) {
    HubFacts facts;
    facts.id = HubId{id};
    facts.id_configured = configured;
    facts.name = "hub-" + std::to_string(id);
    facts.unique.bytes[0] = static_cast<std::uint8_t>(id);
    facts.unique.bytes[1] = 1;
    facts.instance = proto::HubInstance{instance != 0 ? instance : 100u + id};
    return facts;
  }
  static LinksOptions accepting() {
    LinksOptions options;
    options.accept = true;
    return options;
  }
  static LinksOptions dialling(const std::string& name = "up", std::uint16_t cost = 0) {
    LinksOptions options;
    options.accept = true;
    DialledLink link;
    link.address.host = "127.0.0.1";
    link.address.port = 7450;
    link.name = name;
    link.cost = cost;
    options.dial.push_back(link);
    return options;
  }
  [[nodiscard]] Links::Moment moment() const {
    return {now, 1'000'000 * now.count() + clock_ahead_ns};
  }
  std::optional<proto::Goodbye> admit(const proto::Hello& hello, const char* transport = "tcp") {
    Stranger stranger;
    stranger.transport = std::make_unique<NoStream>();
    stranger.peer = PeerInfo{transport, "127.0.0.1:5000"};
    return links.admit(stranger, hello, moment());
  }
  /// The last AttachCommand that a shard got, or one before it.
  [[nodiscard]] const AttachCommand& attached(std::size_t before = 0) const {
    const auto all = shards.all<AttachCommand>();
    return *all[all.size() - 1 - std::min(before, all.size() - 1)];
  }
  /// So many connections were attached after that of `session`.
  [[nodiscard]] std::size_t attached_after(const SessionRef& session) const {
    const auto all = shards.all<AttachCommand>();
    const auto found = std::find_if(all.rbegin(), all.rend(), [&](const AttachCommand* each) {
      return each->session.generation == session.generation;
    });
    return static_cast<std::size_t>(found - all.rbegin());
  }
  /// The frames that shards were told to send since the last call.
  std::vector<SendControlCommand> take_frames() {
    std::vector<SendControlCommand> frames;
    for (const auto* command : shards.all<SendControlCommand>()) frames.push_back(*command);
    const std::size_t taken = std::exchange(taken_, frames.size());
    frames.erase(frames.begin(), frames.begin() + static_cast<std::ptrdiff_t>(taken));
    return frames;
  }
  void detach(const AttachCommand& of, proto::GoodbyeCode code = proto::GoodbyeCode::done,
              bool said_by_peer = false) {
    DetachedEvent event{of.session, of.attachment, of.node, said_by_peer, code, {}};
    event.epoch = 11;
    event.peer_epoch = 12;
    event.taken = 5;
    links.on_detached(event, moment());
  }
  void pass(std::chrono::milliseconds time) {
    now += time;
    links.tick(moment());
  }

  Limits limits;
  HubFacts facts;
  FakeShards shards{1};
  SlotPool slots{1};
  RouteTable routes;
  Membership membership{Sessions::Options{facts.id, 1, Placement::spread}, limits};
  Watches watches{HubTitle{facts.id, facts.name}, 1, limits};
  NetworkNames names{{facts, limits, membership, watches}};
  NodeTable node_table;
  GroupTable group_table;
  Quiescence quiescence{1};
  TablePublisher publisher{facts.id, 1, {node_table, group_table, quiescence}};
  GroupLinks groups{{facts, limits, shards, membership, publisher, names}};
  std::vector<Dialled> dialled;
  std::chrono::milliseconds now{10'000};
  std::int64_t clock_ahead_ns = 0;
  std::uint64_t random = 0;
  Links links;

 private:
  std::size_t taken_ = 0;
};

/// Two hubs of which one dials the other.
struct LinkedRigs {
  explicit LinkedRigs(LinksOptions dial = LinkRig::dialling())
      : a(1, LinkRig::accepting()), b(2, std::move(dial)) {}

  /// `b` dials, and both attach the connection. `resumed`: what the shard of `a` said.
  void connect(bool resumed = false) {
    b.links.tick(b.moment());
    ASSERT_FALSE(b.dialled.empty());
    const LinkRig::Dialled dialled = b.dialled.back();
    const auto refusal = a.admit(dialled.hello);
    ASSERT_FALSE(refusal) << refusal->sentence;
    proto::Welcome welcome = a.attached().welcome;
    welcome.resumed = resumed;
    b.links.on_dialled(dialled.link, net::Welcomed{std::make_unique<NoStream>(), welcome},
                       b.moment());
  }
  /// Carries control frames to and fro until none is under way.
  void carry() {
    for (bool moved = true; moved;) {
      moved = carry(a, b);
      moved = carry(b, a) || moved;
    }
  }
  static bool carry(LinkRig& from, LinkRig& to) {
    const auto frames = from.take_frames();
    for (const SendControlCommand& command : frames) {
      const AttachCommand& at = to.attached(from.attached_after(command.session));
      to.links.on_route(at.session, at.attachment,
                        std::span{command.frame}.subspan(proto::kHeaderSize), to.moment());
    }
    return !frames.empty();
  }
  void pass(std::chrono::milliseconds time) {
    a.pass(time);
    b.pass(time);
    carry();
  }
  /// Connects, and waits until both have computed their routes.
  void link() {
    connect();
    carry();
    pass(NetworkState::kMapPause);
    pass(NetworkState::kMapPause);
  }

  LinkRig a;
  LinkRig b;
};

}  // namespace gimnet::hub
