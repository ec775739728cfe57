#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "hub/control/state/watches.hpp"

// Tests name the members that matter and leave the others at their defaults, on purpose.
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"

namespace gimnet::hub {

/// A hub's state and those who watch it, who take what they are told when the test says so.
class WatchedHub {
 protected:
  Session& join(const std::string& name) {
    JoinRequest request;
    request.name = name;
    request.origin = PeerAddress{"tcp", "127.0.0.1:5000"};
    Effects effects;
    Session& session = *membership.join(request, now, effects)->session;
    note(effects);
    return session;
  }
  void end(Session& session, bool for_good) {
    Effects effects;
    membership.connection_ended(session, {for_good, proto::GoodbyeCode::done, ""}, now, effects);
    note(effects);
  }
  GroupIndex advertise(const Session& session, const std::string& service,
                       const std::string& metadata = {}) {
    Effects effects;
    ServiceTerms terms;
    terms.metadata = metadata;
    const auto done = membership.services().advertise(
        session.index, session.name.str() + "/" + service, terms, now, effects);
    EXPECT_TRUE(done);
    note(effects);
    return done->group;
  }
  void note(const Effects& effects) {
    for (const Effect& effect : effects) {
      if (const auto* node = std::get_if<NodeNoted>(&effect)) watches.note(*node, membership, now);
      if (const auto* service = std::get_if<ServiceNoted>(&effect))
        watches.note(*service, membership, now);
    }
  }
  proto::Status watch(const Session& session, const proto::ns::Watch& wanted) {
    const auto answer = watches.watch(session.index, wanted);
    return answer ? proto::Status::done : answer.error().status;
  }
  void serve() {
    while (watches.serve(membership, now, [this](NodeIndex node, const proto::Payload& payload) {
      EXPECT_LE(payload.size(), limits.watch_event_bytes);
      const auto events = proto::decode<proto::ns::WatchEvents>(payload);
      ASSERT_TRUE(events) << events.error().sentence;
      waiting[node].push_back(*events);
    })) {
    }
  }
  /// Takes all that a node was told and has not taken yet, as "kind name".
  std::vector<std::string> take(const Session& session) {
    std::vector<std::string> told;
    for (serve(); !waiting[session.index].empty(); serve()) {
      const proto::ns::WatchEvents events = waiting[session.index].front();
      waiting[session.index].pop_front();
      watches.taken(session.index, {events.watch, 1});
      for (const proto::ns::Change& change : events.changes) told.push_back(text_of(change));
    }
    return told;
  }
  static std::string text_of(const proto::ns::Change& change) {
    static const std::map<proto::ns::ChangeKind, std::string> kKinds{
        {proto::ns::ChangeKind::begin, "begin"},
        {proto::ns::ChangeKind::present, "present"},
        {proto::ns::ChangeKind::end, "end"},
        {proto::ns::ChangeKind::joined, "joined"},
        {proto::ns::ChangeKind::left, "left"},
        {proto::ns::ChangeKind::away, "away"},
        {proto::ns::ChangeKind::back, "back"},
        {proto::ns::ChangeKind::renamed, "renamed"},
        {proto::ns::ChangeKind::changed, "changed"},
        {proto::ns::ChangeKind::advertised, "advertised"},
        {proto::ns::ChangeKind::withdrawn, "withdrawn"}};
    std::string text = kKinds.at(change.kind);
    if (change.node) text += " " + change.node->name;
    if (change.service) text += " " + change.service->name;
    if (!change.former_name.empty()) text += " from " + change.former_name;
    return text;
  }

  static constexpr std::uint64_t kEpoch = 77;
  static constexpr HubId kHub{7};

  using Texts = std::vector<std::string>;
  Limits limits;
  std::chrono::milliseconds now{1'000};
  Membership membership{Sessions::Options{kHub, 2, Placement::spread}, limits};
  Watches watches{HubTitle{kHub, "hub-7"}, kEpoch, limits};
  std::map<NodeIndex, std::deque<proto::ns::WatchEvents>> waiting;
};

}  // namespace gimnet::hub
