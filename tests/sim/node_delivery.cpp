#include <algorithm>
#include <array>

#include "proto/frame/flow.hpp"
#include "tests/sim/node.hpp"

// Simulated nodes advertise, subscribe, count the messages that they take, and credit them.

namespace gimnet::sim {

namespace ns = proto::ns;

namespace {
/// So few that each has several subscribers.
constexpr std::size_t kOffered = 12;
}  // namespace

void SimNode::advertise(const std::string& service, bool anew) {
  ns::Advertise offer;
  offer.service = service;
  // Two of eight take data, one of them among those that others subscribe to.
  if (service == "s3" || service == "s7") offer.direction = ns::Direction::accepts;
  const auto known = provides_.find(service);
  if (known != provides_.end()) offer = known->second.offer;
  if (anew) offer.message_type = static_cast<std::uint32_t>(around_.setting.random.below(4));
  offer.metadata = around_.setting.random.chance(500) ? "about it" : "";
  if (anew || known == provides_.end()) draw_delivery(offer);
  if (!registered_.empty()) tell_others(registered_ + "/" + service);
  ask(offer, about(service, offer));
}

/// So that somebody subscribes to it: sometimes in the place of another one.
void SimNode::tell_others(const std::string& full_name) {
  std::vector<std::string>& offered = around_.setting.offered;
  if (offered.size() < kOffered) {
    offered.push_back(full_name);
  } else if (around_.setting.random.chance(100)) {
    around_.setting.random.pick(offered) = full_name;
  }
}

/// Most are stream; one in 50 is not legal.
void SimNode::draw_delivery(ns::Advertise& offer) {
  Random& random = around_.setting.random;
  const Plan& plan = around_.setting.plan;
  const auto most = static_cast<std::uint32_t>(plan.limits.sync_window);
  const bool latest = random.chance(plan.latest);
  const bool counted = random.chance(plan.sync);
  const auto window = static_cast<std::uint32_t>(random.below(most + 1));
  offer.delivery = latest ? ns::Delivery::latest : ns::Delivery::stream;
  if (counted) offer.delivery = ns::Delivery::sync;
  offer.window = counted ? window : 0;
  offer.retain = random.chance(plan.retain);
  const bool illegal = faulty() && random.chance(20);
  // A service that accepts data has no subscribers to pace.
  if (offer.direction == ns::Direction::accepts && !illegal) {
    offer.delivery = ns::Delivery::stream;
    offer.window = 0;
    offer.retain = false;
  }
  if (illegal) offer.window = most + 1;
}

/// Mostly one that somebody offers, or did.
std::string SimNode::some_service(std::uint64_t number) {
  Setting& setting = around_.setting;
  if (!setting.offered.empty() && setting.random.chance(700))
    return setting.random.pick(setting.offered);
  return some_name() + "/s" + std::to_string(number);
}

void SimNode::send_message(proto::Kind kind, std::uint32_t dst, proto::Policy policy) {
  const std::uint64_t number = ++around_.setting.messages;
  send(kind, dst, std::as_bytes(std::span{&number, 1}), static_cast<std::uint8_t>(policy));
}

/// One message or several, which come too fast for most windows.
void SimNode::publish(const Provided& service) {
  if (service.group == GroupId{}) return;
  Random& random = around_.setting.random;
  const ns::Delivery delivery = service.offer.delivery;
  for (std::uint64_t count = random.between(1, 6); count > 0; --count) {
    const bool latest =
        delivery == ns::Delivery::latest || (delivery == ns::Delivery::sync && random.chance(300));
    send_message(proto::Kind::group, service.group.value(),
                 latest ? proto::Policy::latest : proto::Policy::kind_default);
  }
}

ns::Subscribe SimNode::some_subscription(const std::string& full_name) {
  constexpr std::array kRates{0.0, 1.0, 5.0, 50.0, 200.0};
  Random& random = around_.setting.random;
  const Plan& plan = around_.setting.plan;
  ns::Subscribe wanted{full_name};
  if (!random.chance(plan.terms)) return wanted;
  wanted.window = static_cast<std::uint32_t>(random.below(plan.limits.sync_window + 1));
  wanted.depth = static_cast<std::uint32_t>(random.between(1, plan.limits.subscription_depth));
  wanted.rate_hz = random.pick(kRates);
  if (faulty() && random.chance(20)) wanted.rate_hz = 1'000.0;
  if (faulty() && random.chance(20)) wanted.depth = 0;
  return wanted;
}

/// One that begins has counts of its own; one that is changed keeps them.
void SimNode::subscribe(const ns::Subscribe& wanted) {
  windows_asked_[wanted.name].insert(wanted.window);
  Open open = about(wanted.name);
  open.wanted = wanted;
  const auto standing = subscribes_.find(wanted.name);
  const bool begins = standing == subscribes_.end() || unsubscribing_.contains(wanted.name);
  open.wanted.number = begins ? next_number_++ : standing->second.wanted.number;
  const ns::Subscribe request = open.wanted;
  ask(request, std::move(open));
}

void SimNode::on_service_moved(Link& from, std::span<const std::byte> payload) {
  const auto event = proto::decode<ns::ServiceMoved>(payload);
  require(event.has_value(), Checker::events, "SERVICE_MOVED cannot be read");
  known_groups_.insert(event->group.value());
  const Known now{event->group, event->provider};
  from.moved[event->name] = now;
  const auto subscribed = subscribes_.find(event->name);
  // An earlier connection, maybe to the hub before its restart, may be that slow.
  if (subscribed == subscribes_.end() || !wire_ || &from != &link()) return;
  const GroupId former = std::exchange(subscribed->second.known, now).group;
  if (former != event->group) {
    from.taken.erase(former.value());
    from.gone.insert(former.value());
  }
  if (event->group != GroupId{})
    know_window(from, event->name, *event, subscribed->second.wanted.number);
}

/// Requires that an event told the state of an answer before: on this connection, or on the last
/// one if nothing changed.
void SimNode::require_told(const Link& from, const std::string& full_name,
                           const Known& known) const {
  const auto before = from.before.find(full_name);
  if (before == from.before.end()) return;
  // The event may wait for its turn, or have been missed.
  const Plan& plan = around_.setting.plan;
  if (plan.missed_event != 0 || plan.limits.told_at_once < plan.nodes) return;
  // Declared so late that it may have ended as undeclared, and begun anew.
  const std::chrono::milliseconds grace{around_.setting.plan.limits.grace_ms};
  if (around_.setting.agenda.now() - from.dialled >= grace) return;
  const auto moved = from.moved.find(full_name);
  if (known == (moved != from.moved.end() ? moved->second : before->second)) return;
  broken(Checker::told, "program " + std::to_string(number_) +
                            " came back, and was not told where '" + full_name +
                            "' is now before it asked");
}

bool SimNode::subscribes_now(const Link& link) {
  return std::any_of(link.open.begin(), link.open.end(), [](const auto& entry) {
    return entry.second.operation == ns::Subscribe::kOperation;
  });
}

void SimNode::on_subscribed(const Open& asked, const ns::SubscribeAnswer& answer) {
  const Known known{answer.group, answer.provider};
  require_told(link(), asked.subject, known);
  require(answer.number == asked.wanted.number, Checker::answers,
          "SUBSCRIBE is answered with another count number");
  subscribes_[asked.subject] = {asked.wanted, known};
  known_groups_.insert(answer.group.value());
  if (answer.group != GroupId{}) know_window(link(), asked.subject, answer, answer.number);
}

void SimNode::know_window(Link& link, const std::string& full_name, const ns::ServiceState& state,
                          std::uint8_t number) {
  Taken& taken = link.taken[state.group.value()];
  link.gone.erase(state.group.value());
  if (taken.number && taken.window == 0 && state.window != 0)
    taken.before_window = around_.setting.messages;
  if (taken.number != number || taken.window == 0) taken.messages = taken.credited = 0;
  taken.number = number;
  taken.window = state.window;
  taken.retained = state.retain;
  if (state.window == 0) {
    taken.window_most = 0;
    return;
  }
  // After several requests any of them may have been in force. 0 asks for the window that the
  // provider offers, which may be the most.
  std::uint32_t most = state.window;
  const std::set<std::uint32_t>& asked = windows_asked_[full_name];
  if (asked.size() > 1) most = std::max(most, *asked.rbegin());
  if (asked.size() > 1 && asked.contains(0))
    most = static_cast<std::uint32_t>(around_.setting.plan.limits.sync_window);
  taken.window_most = std::max(taken.window_most, most);
  if (taken.messages > taken.credited) credit_later(link, state.group);
}

void SimNode::take_message(Link& from, GroupId group, std::uint64_t message) {
  if (from.gone.contains(group.value())) return;
  Taken& taken = from.taken[group.value()];
  // A new subscription begins with the last message, which an earlier one may have had, too.
  const bool again = message == taken.last;
  const Checker minds = taken.retained ? Checker::retained : Checker::pace;
  require(message > taken.last || (again && (taken.retained || taken.window_most == 0)), minds,
          "a subscriber gets an older message after a newer one");
  taken.last = message;
  if (!taken.number) return;  // its SUBSCRIBE is not answered yet
  ++taken.messages;
  const bool asks = std::any_of(from.open.begin(), from.open.end(), [](const auto& entry) {
    return entry.second.operation == ns::Subscribe::kOperation;
  });
  // Before the answer it does not know what is in force.
  const bool within = taken.window_most == 0 || asks || message <= taken.before_window ||
                      taken.messages - taken.credited <= taken.window_most;
  require(within, Checker::credit,
          "a subscriber gets more messages than its window, not counting what it credited");
  if (taken.window == 0) return;
  if (faulty() && around_.setting.random.chance(around_.setting.plan.late_credit)) {
    credit_later(from, group);
  } else {
    credit(from, group);
  }
}

/// By its present connection: one that it replaced itself, or is about to, is counted no more.
void SimNode::credit(Link& from, GroupId group) {
  const auto found = from.taken.find(group.value());
  if (found == from.taken.end()) return;
  Taken& taken = found->second;
  taken.credit_due = false;
  if (wire_ == nullptr || from.wire != wire_ || !from.welcomed || taken.credited == taken.messages)
    return;
  taken.credited = taken.messages;
  std::array<std::byte, proto::flow::kSizeMax> bytes{};
  const std::size_t size = proto::flow::encode(
      proto::flow::Credit{group, taken.messages, taken.number.value_or(0)}, bytes);
  send(proto::Kind::flow, 0, std::span{bytes}.first(size));
}

void SimNode::credit_later(Link& from, GroupId group) {
  Taken& taken = from.taken.at(group.value());
  if (taken.credit_due) return;
  taken.credit_due = true;
  around_.setting.census.add(Happening::credit_delayed);
  const Time delay{around_.setting.random.between(1, 300'000)};
  around_.setting.agenda.after(delay, [this, group, number = from.wire->number] {
    const auto found = links_.find(number);
    if (found == links_.end()) return;
    if (!hung_) return credit(found->second, group);
    const auto waiting = found->second.taken.find(group.value());
    if (waiting == found->second.taken.end()) return;
    waiting->second.credit_due = false;
    credit_later(found->second, group);
  });
}

}  // namespace gimnet::sim
