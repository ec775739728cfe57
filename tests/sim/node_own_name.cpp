#include "proto/control/ctrl.hpp"
#include "proto/control/ns_register.hpp"
#include "proto/control/ns_watch.hpp"
#include "tests/sim/node.hpp"

// A simulated node changes its own name, and watches everything.

namespace gimnet::sim {

namespace ns = proto::ns;

namespace {
constexpr std::uint32_t kWatch = 1;
/// One node in so many watches.
constexpr std::uint32_t kWatchers = 16;
}  // namespace

void SimNode::watch_or_rename(std::uint64_t choice) {
  if (choice < 67) {
    const std::string name = some_name();
    return ask(ns::RegisterName{name}, about(name));
  }
  if (choice == 67) return ask(ns::UnregisterName{}, {});
  if (choice == 68 && watches_) return ask(ns::Unwatch{kWatch}, {});
  if (choice == 69) return ask(ns::Unwatch{kWatch + 5}, {});
  // Few, so that one that comes back finds its place free and can go on.
  if (!wants_watch_ && number_ % kWatchers == 0) watch();
}

/// One thing after the other, as many at once as it may ask for: names, services, subscriptions, or
/// what nobody grants.
void SimNode::flood() {
  Random& random = around_.setting.random;
  const std::uint64_t with = random.below(4);
  around_.setting.trace.note("node {a} floods the hub, in way {b}", number_, with);
  while (link().open.size() < around_.setting.plan.limits.requests) {
    const std::string name = some_name();
    const std::string service = "s" + std::to_string(random.below(8));
    if (with == 1) {
      advertise(service, true);
    } else if (with == 2) {
      subscribe(ns::Subscribe{name + "/" + service});
    } else if (with == 3) {
      ask(proto::ctrl::Kick{id_, "it asks in vain"}, {}, proto::Kind::ctrl);
    } else {
      ask(ns::RegisterName{name}, about(name));
    }
  }
}

void SimNode::watch() {
  Random& random = around_.setting.random;
  if (!wants_watch_)
    view_ = {some_pattern(random.chance(500)), static_cast<std::uint8_t>(random.between(1, 3))};
  wants_watch_ = true;
  ask(view_.request(kWatch), {});
}

/// Sooner or later, so that the hub holds changes back and has to begin again. Never a request too
/// many.
void SimNode::say_taken() {
  if (untaken_ == 0 || !is_up() || link().open.size() >= around_.setting.plan.limits.requests)
    return;
  ask(ns::WatchTaken{kWatch, untaken_}, {});
  untaken_ = 0;
}

void SimNode::on_own_name(const Open& asked, std::span<const std::byte> payload) {
  if (asked.operation == ns::RegisterName::kOperation) {
    const auto answer = proto::decode_answer<ns::RegisterNameAnswer>(payload);
    if (answer->name != registered_) provides_.clear();
    wish_ = registered_ = answer->name;
    token_ = answer->token;
  } else if (asked.operation == ns::UnregisterName::kOperation) {
    provides_.clear();
    wish_ = registered_ = "";
    token_ = proto::decode_answer<ns::UnregisterNameAnswer>(payload)->token;
  } else if (asked.operation == ns::Watch::kOperation) {
    watches_ = true;
    view_.granted(proto::decode_answer<ns::WatchAnswer>(payload)->snapshot);
  } else if (asked.operation == ns::Unwatch::kOperation) {
    watches_ = wants_watch_ = false;
    view_ = {};
  }
}

void SimNode::on_watch_events(std::span<const std::byte> payload) {
  const auto events = proto::decode<ns::WatchEvents>(payload);
  require(events.has_value(), Checker::events, "WATCH_EVENTS cannot be read");
  ++untaken_;
  if (!watches_ || events->watch != kWatch) return;
  view_.take(*events, around_.setting.census);
  const bool soon = around_.setting.random.chance(700);
  if (soon || !faulty()) say_taken();
}

}  // namespace gimnet::sim
