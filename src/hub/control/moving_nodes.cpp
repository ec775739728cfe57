#include "hub/control/moving_nodes.hpp"

#include <utility>

#include "hub/control/log_peer.hpp"
#include "hub/control/waiting_room.hpp"
#include "hub/shard/control_frame.hpp"
#include "proto/control/ns_register.hpp"

namespace gimnet::hub {

using std::chrono::milliseconds;

JoinRequest join_request_of(const Stranger& stranger, const proto::Hello& hello, milliseconds wall,
                            bool had_name) {
  JoinRequest request;
  request.role = hello.role;
  request.name = hello.name;
  request.token = hello.token;
  request.identity = stranger.identity;
  request.rights = stranger.rights;
  request.description = hello.description;
  request.shard_hint = hello.shard;
  request.origin = PeerAddress{stranger.peer.transport, stranger.peer.address};
  // Root and the hub's own user need no bound: they can end the hub.
  if (!stranger.rights.administer)
    request.crowd = crowd_of(stranger.identity, stranger.peer.address);
  request.resumes = hello.resume;
  request.wall = wall;
  request.former = hello.former;
  request.had_name = had_name;
  return request;
}

bool MovingNodes::take(Stranger& stranger, const proto::Hello& hello, milliseconds now) {
  const HubId hub = hub_of(hello.former);
  const bool from_elsewhere = hub != kOwnHub && hub != parts_.facts.id && !hello.token.empty();
  if (hello.role != proto::Role::node || !from_elsewhere) return false;
  if (waiting_.size() >= parts_.limits.handshakes) return false;
  if (++last_request_ == proto::kNoRequest) ++last_request_;
  const auto request = proto::encode(
      proto::ns::LetGo{hello.name, hello.token, stranger.identity.user()}, last_request_);
  const bool asked = parts_.links.next_hops().send_towards(
      hub,
      control_frame(proto::Kind::ns, make_id<NodeId>(hub, kHubIndex), parts_.facts.id, request));
  if (!asked) return false;
  // The answer may come behind the news that the name is free, and then the claim is gone.
  const NameCopies* const copies = parts_.names.copies();
  const auto known = copies == nullptr ? std::nullopt : copies->find(hello.name);
  const bool had_name = known && known->claim->node == hello.former;
  waiting_.push_back({std::move(stranger), hello, last_request_, now + kAnswerTime, had_name});
  return true;
}

void MovingNodes::take_answer(const HubAnswer& answer) {
  for (Waiting& each : waiting_) {
    if (each.request != answer.request || hub_of(each.hello.former) != answer.from) continue;
    each.answered = true;
    each.let_go = answer.status == proto::Status::done;
  }
}

void MovingNodes::settle(std::span<const HubAnswer> answers, milliseconds now, const Admit& admit) {
  for (const HubAnswer& answer : answers) take_answer(answer);
  const NextHops& hops = parts_.links.next_hops();
  std::list<Waiting> due;  // Limit: those that wait
  for (auto each = waiting_.begin(); each != waiting_.end();) {
    const auto next = std::next(each);
    if (each->answered || each->until <= now || !hops.find(hub_of(each->hello.former)).exists())
      due.splice(due.end(), waiting_, each);
    each = next;
  }
  for (Waiting& each : due) {
    if (each.let_go) parts_.names.note_let_go(each.hello.name, hub_of(each.hello.former));
    const bool had_name = each.let_go && each.had_name;
    if (const auto refusal = admit(each.stranger, each.hello, had_name))
      turn_away(each.stranger, *refusal);
  }
}

/// It has said nothing behind HELLO, so closing at once throws nothing away.
void MovingNodes::turn_away(const Stranger& stranger, const proto::Goodbye& goodbye) {
  log_refusal(stranger.peer, goodbye);
  if (parts_.refusals != nullptr) parts_.refusals->count(goodbye.code);
  static_cast<void>(send_goodbye(*stranger.transport, goodbye.code, goodbye.sentence));
}

std::optional<milliseconds> MovingNodes::next_due() const {
  return waiting_.empty() ? std::nullopt : std::optional{waiting_.front().until};
}

}  // namespace gimnet::hub
