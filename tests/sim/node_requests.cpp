#include <algorithm>

#include "proto/control/ctrl.hpp"
#include "proto/control/ns_watch.hpp"
#include "tests/sim/node.hpp"
#include "tests/sim/shards.hpp"

// Questions and frames that a simulated node sends, and its use of the answers.

namespace gimnet::sim {

using proto::Kind;
namespace ns = proto::ns;
namespace ctrl = proto::ctrl;

void SimNode::send(Kind kind, std::uint32_t dst, std::span<const std::byte> payload,
                   std::uint8_t flags) {
  proto::FrameHeader header;
  header.dst = dst;
  header.src = link().id.value();
  header.kind = kind;
  header.flags = flags;
  around_.network.to_hub(wire_, frame_of(header, payload));
}

void SimNode::ask_raw(Kind kind, const proto::Payload& payload, Open open) {
  open.kind = kind;
  if (const auto view = proto::split_control(payload)) {
    around_.setting.trace.note("node {a} asks operation {b} as request {c}: {t}", number_,
                               view->header.operation, view->header.request, open.subject);
    link().open[view->header.request] = std::move(open);
  }
  send(kind, 0, payload);
}

void SimNode::ask_something() {
  Random& random = around_.setting.random;
  if (link().open.size() >= around_.setting.plan.limits.requests) return;
  const std::uint64_t choice = random.below(100);
  if (choice < 25) return ask_about_names(choice);
  if (choice < 65) return change_services(choice);
  if (choice < 72) return watch_or_rename(choice);
  send_something();
}

void SimNode::ask_about_names(std::uint64_t choice) {
  Random& random = around_.setting.random;
  if (choice < 10) return ask(ns::Resolve{some_name()}, {});
  if (choice < 13 && !known_.empty()) return ask(ns::Reverse{random.pick(known_)}, {});
  if (choice < 17) {
    ns::List list;
    list.pattern = some_pattern(false);
    list.records_max = static_cast<std::uint32_t>(random.between(1, 50));
    if (!known_.empty() && random.chance(500)) list.after = random.pick(known_);
    return ask(list, {});
  }
  if (choice < 20) {
    ns::ServicesRequest list;
    list.pattern = some_pattern(true);
    list.records_max = static_cast<std::uint32_t>(random.between(1, 50));
    return ask(list, {});
  }
  if (choice == 20) return ask(ctrl::HubInfo{}, {}, Kind::ctrl);
  if (choice == 21) return ask(ctrl::Connections{}, {}, Kind::ctrl);
  if (choice == 22) return ask(ctrl::Statistics{}, {}, Kind::ctrl);
  if (choice == 23) return ask(ns::List{.pattern = "*/**/[", .after = {}}, {});
  // Operations that there are not, and bodies that cannot be read.
  proto::Payload odd = proto::encode(ns::Resolve{"x"}, ++link().last_request);
  odd[random.chance(500) ? 1 : odd.size() - 1] = std::byte{0x7F};
  ask_raw(random.chance(500) ? Kind::ns : Kind::ctrl, odd, {});
}

void SimNode::change_services(std::uint64_t choice) {
  Random& random = around_.setting.random;
  const std::uint64_t which = random.below(8);
  if (choice < 38) return advertise("s" + std::to_string(which), false);
  if (choice < 42 && !provides_.empty()) {
    auto entry = provides_.begin();
    std::advance(entry, static_cast<std::ptrdiff_t>(random.below(provides_.size())));
    return advertise(entry->first, true);
  }
  if (choice < 46 && !provides_.empty()) {
    auto entry = provides_.begin();
    std::advance(entry, static_cast<std::ptrdiff_t>(random.below(provides_.size())));
    return ask(ns::Withdraw{entry->second.group}, about(entry->first));
  }
  if (choice < 48 && !subscribes_.empty()) {
    auto entry = subscribes_.begin();
    std::advance(entry, static_cast<std::ptrdiff_t>(random.below(subscribes_.size())));
    return subscribe(some_subscription(entry->first));
  }
  if (choice < 58) return subscribe(some_subscription(some_service(which % 4)));
  if (choice < 63 && !subscribes_.empty()) {
    auto entry = subscribes_.begin();
    std::advance(entry, static_cast<std::ptrdiff_t>(random.below(subscribes_.size())));
    unsubscribing_.insert(entry->first);
    return ask(ns::Unsubscribe{entry->first}, about(entry->first));
  }
  if (choice == 63) {
    const auto group = make_id<GroupId>(hub_of(id_), static_cast<std::uint32_t>(which + 1));
    Open perhaps_own = about("");
    perhaps_own.group = group;
    return ask(ns::Withdraw{group}, std::move(perhaps_own));
  }
  ns::Advertise wrong;
  wrong.service = "not/one/part";
  ask(wrong, about(wrong.service, wrong));
}

void SimNode::send_something() {
  Random& random = around_.setting.random;
  const std::uint64_t choice = random.below(10);
  if (choice < 5) {
    if (!known_.empty()) send_message(Kind::unicast, random.pick(known_).value());
    return;
  }
  if (choice < 9 && !provides_.empty()) {
    auto entry = provides_.begin();
    std::advance(entry, static_cast<std::ptrdiff_t>(random.below(provides_.size())));
    return publish(entry->second);
  }
  for (const auto& [full_name, subscribed] : subscribes_) {
    if (subscribed.known.group == GroupId{}) continue;
    // Only the provider may send to its subscribers; everybody may send to the provider, if its
    // service takes data.
    const bool legal = random.chance(700);
    return send_message(legal ? Kind::service : Kind::group, subscribed.known.group.value());
  }
}

void SimNode::on_control(Link& from, std::span<const std::byte> payload) {
  const auto view = proto::split_control(payload);
  require(view.has_value(), Checker::answers, "a control frame cannot be read");
  if (!view->header.is_answer()) return on_event(from, view->header.operation, payload);
  const auto asked = from.open.find(view->header.request);
  require(asked != from.open.end(), Checker::answers,
          "a node gets an answer to what it did not ask here");
  const Open open = asked->second;
  around_.setting.trace.note("node {a} has its answer to request {b}: {c}", number_,
                             view->header.request,
                             static_cast<std::uint64_t>(proto::read_status(view->body).status));
  from.open.erase(asked);
  if (!faulty()) say_taken();
  if (open.operation == 0) return;
  require(view->header.operation == (open.operation | proto::kAnswerBit), Checker::answers,
          "a node gets the answer to another request");
  if (open.kind == Kind::ns && wire_ != nullptr && &from == &link()) on_answer(open, payload);
}

void SimNode::on_answer(const Open& asked, std::span<const std::byte> payload) {
  const bool done =
      proto::read_status(proto::split_control(payload)->body).status == proto::Status::done;
  switch (asked.operation) {
    case ns::Resolve::kOperation:
      if (done) learn(proto::decode_answer<ns::ResolveAnswer>(payload)->node);
      break;
    case ns::List::kOperation:
      if (done) {
        const auto answer = proto::decode_answer<ns::ListAnswer>(payload);
        for (std::size_t i = 0; i < answer->nodes.size(); i += 7) learn(answer->nodes[i].node);
      }
      break;
    case ns::Advertise::kOperation:
      if (done) {
        const auto answer = proto::decode_answer<ns::AdvertiseAnswer>(payload);
        provides_[asked.subject] = {asked.offer, answer->group};
      }
      break;
    case ns::Withdraw::kOperation:
      if (done) {
        std::erase_if(provides_, [&asked](const auto& entry) {
          return entry.first == asked.subject || entry.second.group == asked.group;
        });
      }
      break;
    case ns::Subscribe::kOperation:
      if (done) on_subscribed(asked, *proto::decode_answer<ns::SubscribeAnswer>(payload));
      link().before.erase(asked.subject);
      break;
    case ns::Unsubscribe::kOperation:
      if (done) subscribes_.erase(asked.subject);
      unsubscribing_.erase(asked.subject);
      break;
    default:
      if (done) on_own_name(asked, payload);
      break;
  }
}

void SimNode::on_event(Link& from, std::uint16_t operation, std::span<const std::byte> payload) {
  if (operation == ns::WatchEvents::kOperation) {
    // Its watch ended with the connection; what that one still brings is older than what the next
    // one told.
    if (wire_ != nullptr && &from == &link()) on_watch_events(payload);
  } else if (operation == ns::ServiceMoved::kOperation) {
    on_service_moved(from, payload);
  } else if (operation == ns::Subscribers::kOperation) {
    require(proto::decode<ns::Subscribers>(payload).has_value(), Checker::events,
            "SUBSCRIBERS cannot be read");
  }
}

void SimNode::on_data(Link& from, const proto::FrameHeader& header, const Bytes& frame) {
  Census& census = around_.setting.census;
  if (header.kind == Kind::unicast) {
    require(header.dst == from.id.value(), Checker::right_session,
            "a node gets a frame for another one");
    census.add(Happening::unicast_delivered);
  } else if (header.kind == Kind::group) {
    // A subscriber is in the table before its answer leaves, so that frames may come before the
    // answer.
    const bool told = known_groups_.contains(header.dst) || subscribes_now(from) || forgot_;
    if (!told && around_.setting.plan.missed_event != 0) return;  // it may have missed the event
    if (!told) {
      broken(Checker::told, "program " + std::to_string(number_) + " gets a frame of group " +
                                std::to_string(index_of(GroupId{header.dst})) +
                                ", of which it was not told");
    }
    census.add(Happening::group_delivered);
    take_message(from, GroupId{header.dst}, message_of(frame));
  } else if (header.kind == Kind::service) {
    census.add(Happening::service_frame_delivered);
  }
}

}  // namespace gimnet::sim
