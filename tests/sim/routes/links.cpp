#include <algorithm>
#include <utility>

#include "tests/sim/routes/world.hpp"

// Links come up, are refused, carry messages and end.

namespace gimnet::sim::routes {
namespace {

constexpr std::uint64_t kDialPauseMost = 1'000;
constexpr std::uint64_t kKeepAlive = 250;
constexpr std::uint64_t kSilence = 1'000;
/// Of a break: how long the routes stay, so that it may be resumed.
constexpr std::uint64_t kResume = 350;

hub::LinkNumber number_of(std::size_t wire) {
  return hub::LinkNumber{static_cast<std::uint32_t>(wire + 1)};
}

/// Null: a keep-alive, for which there is none.
std::uint16_t operation_of(const std::shared_ptr<const proto::Payload>& bytes) {
  return bytes == nullptr ? 0 : proto::split_control(*bytes)->header.operation;
}
bool is_record(const std::shared_ptr<const proto::Payload>& bytes) {
  return operation_of(bytes) == proto::route::RecordPart::kOperation;
}

}  // namespace

void World::dial_again(std::size_t wire) {
  after_ms(random_.between(1, kDialPauseMost), [this, wire] {
    dial(wire);
    dial_again(wire);
  });
}

void World::dial(std::size_t wire) {
  Wire& each = wires_[wire];
  const auto [dialler, acceptor] = std::pair(each.ends[0].hub, each.ends[1].hub);
  if (!each.wanted || each.cut || each.ends[0].open || now() < each.dial_not_before) return;
  if (!takes_part(dialler) || !takes_part(acceptor)) return;
  const auto answer = admit(acceptor, dialler);
  if (answer.admission != hub::LinkAdmission::accept) {
    refuse(wire, 1, answer);
    return;
  }
  after_ms(random_.between(1, plan_.delay_ms),
           [this, wire, of_dialler = hubs_[dialler].life, of_acceptor = hubs_[acceptor].life] {
             welcome(wire, of_dialler, of_acceptor);
           });
}

/// A hub that has an id in the network keeps it, whatever a newcomer says of itself.
hub::LinkAdmissionAnswer World::admit(std::size_t at, std::size_t newcomer) {
  const hub::NetworkState& state = *hubs_[at].state;
  const hub::HubIdentity said = identity(newcomer);
  const auto answer = state.admit(said);
  const auto& known = state.map().reachable();
  const bool is_taken = std::ranges::find(known, said.key.hub, &proto::HubKey::hub) != known.end();
  const bool is_known = std::ranges::find(known, said.key) != known.end();
  if (answer.admission == hub::LinkAdmission::accept && is_taken && !is_known)
    fail(Checker::one_id, "hub " + std::to_string(at) + " admits a newcomer with an id in use");
  return answer;
}

void World::welcome(std::size_t wire, std::uint64_t dialler_life, std::uint64_t acceptor_life) {
  Wire& each = wires_[wire];
  const auto [dialler, acceptor] = std::pair(each.ends[0].hub, each.ends[1].hub);
  if (each.ends[0].open || each.cut || !each.wanted) return;
  if (hubs_[dialler].life != dialler_life || hubs_[acceptor].life != acceptor_life) return;
  if (!takes_part(dialler) || !takes_part(acceptor)) return;
  const auto answer = admit(dialler, acceptor);
  if (answer.admission != hub::LinkAdmission::accept) {
    refuse(wire, 0, answer);
    return;
  }
  each.refusal.reset();
  open(wire, 0, ++last_number_);
}

void World::open(std::size_t wire, int end, std::uint64_t connection) {
  Wire& each = wires_[wire];
  End& mine = each.ends[static_cast<std::size_t>(end)];
  const std::size_t other = each.ends[static_cast<std::size_t>(1 - end)].hub;
  mine.open = true;
  mine.connection = connection;
  mine.peer = identity(other).key;
  hub::LinkFacts facts{identity(other), each.plan.name, end == 0,
                       each.plan.costs[static_cast<std::size_t>(end)]};
  hubs_[mine.hub].state->begin_connection(number_of(wire), std::move(facts), now());
  hubs_[mine.hub].state->set_damped(number_of(wire), mine.damped);
  hubs_[mine.hub].names->begin_connection(number_of(wire), now());
  turn(mine.hub);
}

void World::close(std::size_t wire, int end, bool tell) {
  Wire& each = wires_[wire];
  End& mine = each.ends[static_cast<std::size_t>(end)];
  if (std::exchange(mine.open, false) && hubs_[mine.hub].state) {
    hubs_[mine.hub].state->end_link(number_of(wire));
    hubs_[mine.hub].names->end_link(number_of(wire));
    after_ms(0, [this, at = mine.hub] { turn(at); });
  }
  // The far end may stand already though the first frame has not come here.
  const End& far = each.ends[static_cast<std::size_t>(1 - end)];
  if (!tell || !far.open) return;
  mine.connection = far.connection;
  if (each.cut) return;
  after_ms(random_.between(1, plan_.delay_ms), [this, wire, end, ended = far.connection] {
    const End& other = wires_[wire].ends[static_cast<std::size_t>(1 - end)];
    if (other.open && other.connection == ended) close(wire, 1 - end, false);
  });
}

void World::refuse(std::size_t wire, int refusing, const hub::LinkAdmissionAnswer& answer) {
  Wire& each = wires_[wire];
  const std::size_t refuser = each.ends[static_cast<std::size_t>(refusing)].hub;
  const std::size_t refused = each.ends[static_cast<std::size_t>(1 - refusing)].hub;
  auto admission = answer.admission;
  if (admission == hub::LinkAdmission::ask_old_link) {
    census_.note(Event::asked_old_link);
    // PING over the old link: does the process at its other end answer?
    const std::size_t old = answer.old_link.value() - 1;
    const int end = wires_[old].ends[0].hub == refuser ? 0 : 1;
    const End& mine = wires_[old].ends[static_cast<std::size_t>(end)];
    const End& far = wires_[old].ends[static_cast<std::size_t>(1 - end)];
    if (!far.open || far.connection != mine.connection || mine.connection <= wires_[old].dead) {
      after_ms(kSilence, [this, old, end, connection = mine.connection] {
        const End& still = wires_[old].ends[static_cast<std::size_t>(end)];
        if (still.open && still.connection == connection) close(old, end, true);
      });
      return;
    }
    admission = hub::LinkAdmission::is_copy;
  }
  each.refusal = {admission, identity(refused), refuser, now()};
  if (admission == hub::LinkAdmission::is_copy) {
    last_copy_ = now();
    census_.note(Event::refused_copy);
    each.dial_not_before = now() + milliseconds(kRetryOfCopies);
  } else if (admission == hub::LinkAdmission::draw_again) {
    census_.note(Event::drew_again);
    leave(refuser, true, milliseconds(1));
  } else if (admission == hub::LinkAdmission::id_taken) {
    census_.note(Event::refused_id);
    if (!hubs_[refused].plan.configured) leave(refused, true, milliseconds(1));
  }
}

void World::pass(std::size_t wire, int to, Message message) {
  Wire& each = wires_[wire];
  const End& from = each.ends[static_cast<std::size_t>(1 - to)];
  End& target = each.ends[static_cast<std::size_t>(to)];
  if (!from.open || each.cut || from.connection <= each.dead) return;
  if (is_record(message.bytes) && std::exchange(target.lose_next, false)) {
    census_.note(Event::lost_record);
    return;
  }
  count_names(target, from.connection, message, 1);
  target.last_arrival =
      std::max(target.last_arrival, now() + milliseconds(random_.between(1, plan_.delay_ms)));
  agenda_.at(target.last_arrival,
             [this, wire, to, connection = from.connection, life = hubs_[target.hub].life,
              message = std::move(message)] { arrive(wire, to, connection, life, message); });
}

void World::arrive(std::size_t wire, int to, std::uint64_t connection, std::uint64_t life,
                   const Message& message) {
  Wire& each = wires_[wire];
  End& mine = each.ends[static_cast<std::size_t>(to)];
  if (each.cut || connection <= each.dead || hubs_[mine.hub].life != life || !takes_part(mine.hub))
    return;
  const End& from = each.ends[static_cast<std::size_t>(1 - to)];
  if (connection != mine.connection || !mine.open) {
    // The first frame of a connection that was accepted begins it at the acceptor.
    if (to == 0 || connection < mine.connection || !from.open || from.connection != connection)
      return;
    if (mine.connection == connection) return;  // it was closed here
    if (mine.open) close(wire, to, false);
    open(wire, to, connection);
  }
  count_names(mine, connection, message, -1);
  hub::NetworkState& state = *hubs_[mine.hub].state;
  if (message.bytes == nullptr) {
    state.take_digest(number_of(wire), message.digest, now());
  } else if (is_record(message.bytes)) {
    take_record(wire, mine.hub, message.bytes);
  } else if (operation_of(message.bytes) == proto::route::RecordsEnd::kOperation) {
    state.take_mark(number_of(wire));
  } else {
    hubs_[mine.hub].names->take(number_of(wire), *message.bytes, now());
  }
  turn(mine.hub);
  arriving_.reset();
}

void World::take_record(std::size_t wire, std::size_t hub, const Payload& bytes) {
  hub::NetworkState& state = *hubs_[hub].state;
  const hub::PartRef part = hub::read_part(*bytes);
  const auto is_known = [&state, &part] {
    const hub::StoredRecord* record = state.store().find(part->said.hub);
    const hub::PartRef known = record == nullptr ? nullptr : record->part(part->said.part);
    return known != nullptr && known->bytes == part->bytes;
  };
  const bool was_known = is_known();
  const auto& ends = wires_[wire].ends;
  const bool round_about = ends[ends[0].hub == hub ? 0 : 1].peer != part->said.hub;
  const bool is_hearsay = round_about && hears_itself(hub, part->said.hub);
  const std::uint64_t refused = state.hearsay();
  state.take_record(number_of(wire), *bytes, now());
  if (state.hearsay() != refused) census_.note(Event::refused_record);
  if (is_hearsay && !was_known && is_known())
    fail(Checker::own_word, "hub " + std::to_string(hub) + " believes link " +
                                std::to_string(wire) + " what a neighbour did not say");
  // One that waits may be taken from another link first, and then goes to this one.
  if (was_known || !is_known()) return;
  arriving_ = bytes;
  arriving_wire_ = wire;
  arriving_hub_ = hub;
}

/// Does a link to that hub carry?
bool World::hears_itself(std::size_t hub, const proto::HubKey& neighbour) const {
  for (std::size_t wire = 0; wire < wires_.size(); ++wire) {
    for (const End& end : wires_[wire].ends) {
      if (end.hub == hub && end.open && end.peer == neighbour &&
          hubs_[hub].state->is_up(number_of(wire)))
        return true;
    }
  }
  return false;
}

void World::keep_alive(std::size_t wire) {
  after_ms(kKeepAlive, [this, wire] {
    for (const int to : {0, 1}) {
      const End& from = wires_[wire].ends[static_cast<std::size_t>(1 - to)];
      if (from.open) pass(wire, to, {nullptr, hubs_[from.hub].state->digest()});
    }
    keep_alive(wire);
  });
}

/// Nothing of the present connection arrives any more, also when the cut is mended.
void World::cut(std::size_t wire) {
  wires_[wire].cut = true;
  wires_[wire].dead = last_number_;
  notice_silence(wire);
}

void World::notice_silence(std::size_t wire) {
  for (const int end : {0, 1}) {
    const auto connection = wires_[wire].ends[static_cast<std::size_t>(end)].connection;
    after_ms(kSilence + random_.below(2 * kResume), [this, wire, end, connection] {
      const auto& ends = wires_[wire].ends;
      const End& mine = ends[static_cast<std::size_t>(end)];
      const End& other = ends[static_cast<std::size_t>(1 - end)];
      const bool carries =
          connection > wires_[wire].dead && other.open && other.connection == connection;
      if (mine.open && mine.connection == connection && !carries) close(wire, end, true);
    });
  }
}

}  // namespace gimnet::sim::routes
