#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "base/log.hpp"
#include "hub/control/handle/names.hpp"
#include "hub/control/handle/services.hpp"
#include "hub/control/network_names.hpp"

namespace gimnet::hub {

inline constexpr LinkNumber kNamesLink{1};

/// A hub's control plane without its conductor.
class Side {
 public:
  explicit Side(std::uint16_t hub)
      : membership(Sessions::Options{HubId{hub}, 1, Placement::spread}, limits),
        watches(HubTitle{HubId{hub}, "hub"}, 1, limits) {
    facts.id = HubId{hub};
    facts.instance = proto::HubInstance{hub};
    limits.page_records = 2;
  }
  Session& join(const std::string& name) {
    JoinRequest request;
    request.name = name;
    request.identity = Identity::open();
    Effects effects;
    Session* session = membership.join(request, now, effects)->session;
    carry_out(effects);
    return *session;
  }
  void advertise(const Session& session, const std::string& full_name,
                 const ServiceTerms& terms = {}) {
    Effects effects;
    ASSERT_TRUE(membership.services().advertise(session.index, full_name, terms, now, effects));
    carry_out(effects);
  }
  void withdraw(const Session& session, const std::string& full_name) {
    Effects effects;
    const GroupIndex group = membership.topics().find(full_name)->service->group;
    ASSERT_FALSE(membership.services().withdraw(session.index, group, now, effects));
    carry_out(effects);
  }
  /// As EffectRunner does.
  void carry_out(const Effects& effects) {
    for (const Effect& effect : effects) {
      if (const auto* node = std::get_if<NodeNoted>(&effect)) {
        watches.note(*node, membership, now);
        names.note(*node);
      } else if (const auto* service = std::get_if<ServiceNoted>(&effect)) {
        watches.note(*service, membership, now);
        names.note(*service);
      } else if (const auto* accepting = std::get_if<AcceptanceChanged>(&effect)) {
        names.note(*accepting);
      } else if (const auto* lost = std::get_if<NameLossDue>(&effect)) {
        lost_names.push_back(lost->name);
      } else if (const auto* moved = std::get_if<ServiceChanged>(&effect)) {
        moved_services.push_back(moved->full_name);
      }
    }
  }
  template <class Answer, class Asked>
  Result<Answer, proto::Refusal> ask(Handler handle, const Session& session, const Asked& asked,
                                     bool own_only = false) {
    Effects effects;
    HandlerContext context{facts, limits, membership, watches, {}, now, effects};
    context.names = &names;
    const proto::Payload payload = proto::encode(asked, 1);
    const auto answer = handle(context, {session, {Asked::kOperation, 1}, payload, own_only});
    carry_out(effects);
    return proto::decode_answer<Answer>(answer);
  }
  /// It loses its connection; its node is waited for.
  void lose(Session& session) {
    Effects effects;
    membership.connection_ended(session, {}, now, effects);
    carry_out(effects);
  }
  std::vector<std::string> watched() {
    std::vector<std::string> told;
    while (watches.serve(membership, now, [&](NodeIndex, const proto::Payload& bytes) {
      const auto events = proto::decode<proto::ns::WatchEvents>(bytes);
      for (const proto::ns::Change& change : events->changes) {
        const std::string kind = std::to_string(static_cast<int>(change.kind));
        if (change.node) told.push_back(kind + " " + change.node->name);
        if (change.service) told.push_back(kind + " " + change.service->name);
      }
    })) {
    }
    return told;
  }

  std::chrono::milliseconds now{10'000};
  HubFacts facts;
  Limits limits;
  Membership membership;
  Watches watches;
  NetworkNames names{{facts, limits, membership, watches}};
  std::vector<std::string> lost_names;
  std::vector<std::string> moved_services;
};

/// Two hubs that tell each other names over a link.
class NetworkNamesTest : public ::testing::Test {
 protected:
  NetworkNamesTest() { set_log_level(LogLevel::off); }
  ~NetworkNamesTest() override { set_log_level(LogLevel::info); }
  void connect() {
    here_.names.begin_connection(kNamesLink, here_.now);
    there_.names.begin_connection(kNamesLink, there_.now);
    reach(here_, there_);
    reach(there_, here_);
    settle();
  }
  static void reach(Side& from, const Side& to) {
    HubIdentity self{{from.facts.id, {}}, from.facts.instance};
    HubIdentity other{{to.facts.id, {}}, to.facts.instance};
    RecordStore store;
    for (const auto& [hub, neighbour] : {std::pair(self, other), std::pair(other, self)}) {
      proto::route::RecordPart part;
      part.hub = hub.key;
      part.instance = hub.instance;
      part.sequence = 1;
      part.name = "far";
      part.neighbours = {{neighbour.key, 1}};
      (void)store.take(make_part(part), from.now);
    }
    const std::vector<CarryingLink> links{{{other.key, 1}, kNamesLink}};
    from.names.set_reachable(NetworkMap(self, store, links), store, from.now);
  }
  /// Until nothing is sent any more.
  void settle() {
    for (bool more = true; more;) {
      more = false;
      for (auto [from, to] : {std::pair(&here_, &there_), std::pair(&there_, &here_)}) {
        for (const Sending& each : from->names.take_sendings(from->now)) {
          to->names.take(kNamesLink, *each.bytes, to->now);
          more = true;
        }
      }
      for (Side* side : {&here_, &there_}) {
        Effects effects;
        side->names.settle(side->now, effects);
        side->carry_out(effects);
      }
    }
  }
  Side here_{5};
  Side there_{9};
};

}  // namespace gimnet::hub
