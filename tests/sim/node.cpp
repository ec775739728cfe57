#include "tests/sim/node.hpp"

#include <utility>

namespace gimnet::sim {

using proto::GoodbyeCode;
using proto::Kind;
using namespace std::chrono_literals;
namespace ns = proto::ns;

namespace {
/// Before the end nobody asks or dials any more, so that all is answered.
constexpr Time kQuietEnd = 2s;
constexpr Time kLastDial = 1s;
/// After the faults nodes act so many times as slowly.
constexpr std::uint64_t kCalm = 4;
/// Among which names are spread.
constexpr std::uint64_t kHalls = 8;
/// One node in so many administers the hub; of the others' acts so many thousandths are tries to.
constexpr std::uint32_t kAdministrators = 20;
constexpr std::uint64_t kTries = 5;
}  // namespace

SimNode::SimNode(const Around& around, std::uint32_t number) : around_(around), number_(number) {
  Random& random = around_.setting.random;
  const Plan& plan = around_.setting.plan;
  const bool nameless = random.chance(plan.nameless);
  const std::string name = some_name();
  wish_ = nameless ? std::string{} : name;
  slow_ = random.chance(plan.slow_reader);
  resumes_ = random.chance(plan.waits_away);
  identity_ = random.chance(500) ? hub::Identity::open() : hub::Identity::of_user(number + 1);
  administers_ = number % kAdministrators == 1;
  if (administers_) identity_ = kAdministrator;
}

std::string SimNode::some_name() {
  const std::uint64_t number = around_.setting.random.below(around_.setting.plan.names);
  return "hall-" + std::to_string(number % kHalls) + "/robot-" + std::to_string(number);
}

/// Of names, or of the full names of services in it.
std::string SimNode::some_pattern(bool of_services) {
  Random& random = around_.setting.random;
  const std::string hall = "hall-" + std::to_string(random.below(kHalls));
  switch (random.below(4)) {
    case 0:
      return {};
    case 1:
      return hall + (of_services ? "/*/s1" : "/*");
    case 2:
      return hall + "/**";
    default:
      return of_services ? "**/s1" : "*/robot-1";
  }
}

bool SimNode::faulty() const {
  return around_.setting.agenda.now() < around_.setting.plan.faults_until;
}

void SimNode::start() {
  around_.setting.agenda.after(Time{around_.setting.random.below(1'000'000)}, [this] {
    act();
    act_later();
  });
}

void SimNode::act_later() {
  const std::uint64_t calm = faulty() || wire_ == nullptr ? 1 : kCalm;
  const std::uint64_t mean_us = calm * around_.setting.plan.acts_ms * std::uint64_t{1'000};
  around_.setting.agenda.after(Time{around_.setting.random.between(1, 2 * mean_us)}, [this] {
    act();
    act_later();
  });
}

void SimNode::act() {
  if (hung_) return;
  const Time now = around_.setting.agenda.now();
  if (wire_ == nullptr) {
    if (now >= not_before_ && now < around_.setting.plan.end - kLastDial) dial();
    return;
  }
  if (faulty() && break_something()) return;
  if (!link().welcomed || now > around_.setting.plan.end - kQuietEnd) return;
  say_taken();
  const std::uint64_t administering = administers_ ? around_.setting.plan.administers : kTries;
  if (faulty() && around_.setting.random.chance(administering)) administer();
  for (std::uint64_t count = around_.setting.random.between(1, 3); count > 0; --count)
    ask_something();
}

bool SimNode::break_something() {
  Setting& setting = around_.setting;
  const Plan& plan = setting.plan;
  if (setting.random.chance(plan.crash)) {
    setting.census.add(Happening::crash);
    fall(false);
  } else if (setting.random.chance(plan.vanish)) {
    setting.census.add(Happening::vanished);
    fall(true);
  } else if (!link().welcomed) {
    return false;
  } else if (setting.random.chance(plan.hang)) {
    hang();
  } else if (setting.random.chance(plan.goodbye)) {
    say_goodbye();
  } else if (setting.random.chance(plan.twin)) {
    setting.census.add(Happening::token_shown_twice);
    setting.trace.note("node {a} dials again beside its connection", number_);
    dial();
  } else if (setting.random.chance(plan.misconduct)) {
    misbehave();
  } else if (setting.random.chance(plan.flood)) {
    flood();
  } else {
    return false;
  }
  return true;
}

void SimNode::fall(bool unseen) {
  Setting& setting = around_.setting;
  setting.trace.note(unseen ? "node {a} vanishes" : "node {a} crashes", number_);
  if (unseen) around_.set_mute(wire_, true);
  around_.network.close_by_node(wire_, unseen);
  lose_connection();
  if (setting.random.chance(setting.plan.lost_token)) forget_life();
  // Back within the grace time, about when it ends, or long after it.
  const std::uint64_t grace_us = setting.plan.limits.grace_ms * 1'000;
  const std::uint64_t when = setting.random.below(3);
  Time absence{setting.random.below(grace_us)};
  if (when == 1) absence = Time{grace_us - 100'000 + setting.random.below(200'000)};
  if (when == 2) absence += Time{grace_us};
  not_before_ = setting.agenda.now() + absence;
  setting.agenda.at(not_before_, [this] { act(); });
}

void SimNode::hang() {
  Setting& setting = around_.setting;
  const std::uint64_t silent_us = setting.plan.limits.silent_ms * 1'000;
  const bool brief = setting.random.chance(500);
  const Time duration{brief ? setting.random.below(silent_us / 2)
                            : silent_us + setting.random.below(silent_us)};
  if (brief) setting.census.add(Happening::short_hang);
  setting.trace.note("node {a} hangs for {b} us", number_,
                     static_cast<std::uint64_t>(duration.count()));
  hung_ = true;
  around_.set_mute(wire_, true);
  setting.agenda.after(duration, [this, wire = wire_] {
    hung_ = false;
    if (wire->node_open) around_.set_mute(wire, false);
    for (const auto& [from, frame] : std::exchange(unheard_, {})) {
      if (frame.empty()) {
        sees_the_end(from);
      } else {
        hears(from, frame);
      }
    }
  });
}

void SimNode::say_goodbye() {
  around_.setting.trace.note("node {a} says GOODBYE", number_);
  const proto::Payload payload = proto::encode(proto::Goodbye{GoodbyeCode::done, ""});
  send(Kind::link, 0, payload);
  around_.network.close_by_node(wire_, false);
  lose_connection();
  forget_life();
  not_before_ = around_.setting.agenda.now() + Time{around_.setting.random.below(3'000'000)};
}

void SimNode::misbehave() {
  Setting& setting = around_.setting;
  setting.trace.note("node {a} misbehaves", number_);
  const std::uint64_t how = setting.random.below(4);
  const std::vector<std::byte> nothing(3);
  if (how == 0) {
    send(Kind::unicast, 0, nothing, proto::kFlagReservedMask);
  } else if (how == 1) {
    ask_raw(Kind::ns, nothing, {});
  } else if (how == 2) {
    send(Kind::route, 0, proto::encode(ns::Resolve{"x"}, 1));
  } else {
    for (std::uint64_t i = 0; i < setting.plan.limits.requests + 8; ++i)
      ask(ns::Resolve{"hall-0/robot-0"}, {});
  }
}

void SimNode::lose_connection() {
  if (wire_ != nullptr) {
    // It may have subscribed to something and does not know it.
    forgot_ = forgot_ || subscribes_now(link());
    links_.erase(wire_->number);
    watches_ = false;
    untaken_ = 0;
  }
  wire_ = nullptr;
}

void SimNode::give_up_others() {
  for (const auto& [number, other] : std::exchange(links_, {}))
    around_.network.close_by_node(other.wire, false);
}

void SimNode::forget_life() {
  if (!token_.empty()) old_token_ = std::exchange(token_, {});
  provides_.clear();
  subscribes_.clear();
  windows_asked_.clear();
  known_.clear();
  view_ = {};
  wants_watch_ = false;
}

void SimNode::dial() {
  forgot_ = forgot_ || (wire_ != nullptr && subscribes_now(link()));
  watches_ = false;
  untaken_ = 0;
  wire_ = around_.network.dial(number_);
  links_[wire_->number].wire = wire_;
  links_[wire_->number].dialled = around_.setting.agenda.now();
  ++dials_;
  hub::Identity identity = identity_;
  const proto::Hello said = hello(identity);
  around_.setting.trace.note("node {a} dials, wire {b}, {c} bytes of token, as: {t}", number_,
                             wire_->number, said.token.size(), said.name);
  around_.say_hello(wire_, said, identity);
}

proto::Hello SimNode::hello(hub::Identity& identity) {
  Random& random = around_.setting.random;
  proto::Hello hello;
  hello.name = wish_;
  hello.token = token_;
  hello.resume = resumes_;
  hello.epoch = random.next();
  hello.description = "node " + std::to_string(number_);
  if (administers_) hello.role = proto::Role::admin;
  if (!faulty()) return hello;
  if (!token_.empty() && random.chance(around_.setting.plan.bad_token))
    spoil_token(hello, identity);
  if (random.chance(around_.setting.plan.rename)) hello.name = some_name();
  if (!token_.empty() && random.chance(100)) hello.name.clear();
  if (random.chance(10)) hello.name = "no name at all";
  if (random.chance(10)) hello.role = random.chance(500) ? proto::Role::hub : proto::Role::admin;
  return hello;
}

void SimNode::spoil_token(proto::Hello& hello, hub::Identity& identity) {
  Setting& setting = around_.setting;
  const std::uint64_t how = setting.random.below(3);
  if (how == 0 && !old_token_.empty()) {
    hello.token = old_token_;
  } else if (how == 1) {
    identity = hub::Identity::of_user(999'999);
  } else {
    setting.census.add(Happening::token_altered);
    const std::uint64_t bit = setting.random.below(8 * hello.token.size());
    hello.token[bit / 8] ^= std::byte{1} << (bit % 8);
  }
}

void SimNode::hears(const WirePointer& wire, const Bytes& frame) {
  if (hung_) {
    unheard_.emplace_back(wire, frame);
    return;
  }
  const auto found = links_.find(wire->number);
  if (found == links_.end()) return;
  const proto::FrameHeader header = proto::load_header(frame.data());
  const auto payload = std::span{frame}.subspan(proto::kHeaderSize);
  if (header.kind == Kind::link) return on_link(wire, payload);
  Link& from = found->second;
  require(from.welcomed, Checker::seam, "a frame comes before WELCOME");
  if (header.kind == Kind::ns || header.kind == Kind::ctrl) {
    require(header.dst == from.id.value(), Checker::right_session,
            "a node gets a control frame for another one");
    return on_control(from, payload);
  }
  on_data(from, header, frame);
}

void SimNode::sees_the_end(const WirePointer& wire) {
  if (hung_) {
    unheard_.emplace_back(wire, Bytes{});
    return;
  }
  around_.setting.trace.note("node {a} sees the end of wire {b}", number_, wire->number);
  if (wire_ == wire) {
    // Refused beside its own earlier connection: then that one is of no use either.
    const bool refused = !link().welcomed;
    // Without a word the hub is not there; it may be soon. A full hub may have room soon, or can
    // write its state again. A bad name or role it says in error only.
    const GoodbyeCode told = link().told.value_or(GoodbyeCode::draining);
    const bool in_error = told == GoodbyeCode::bad_name || told == GoodbyeCode::not_allowed;
    const bool for_now = told == GoodbyeCode::draining || told == GoodbyeCode::hub_full;
    const bool soon_again = refused && (for_now || in_error);
    lose_connection();
    // Half of those who were kicked show their token all the same.
    if (std::exchange(was_kicked_, false) && around_.setting.random.chance(500)) forget_life();
    if (refused) give_up_others();
    const std::uint64_t soon_us = around_.setting.random.between(20'000, 600'000);
    not_before_ = around_.setting.agenda.now() + Time{refused ? 3 * soon_us : soon_us};
    if (!refused || soon_again) around_.setting.agenda.at(not_before_, [this] { act(); });
  } else {
    links_.erase(wire->number);
  }
}

void SimNode::on_link(const WirePointer& wire, std::span<const std::byte> payload) {
  if (proto::split_control(payload)->header.operation == proto::Welcome::kOperation) {
    const auto welcome = proto::decode<proto::Welcome>(payload);
    require(welcome.has_value(), Checker::answers, "WELCOME cannot be read");
    return on_welcome(wire, *welcome);
  }
  const auto goodbye = proto::decode<proto::Goodbye>(payload);
  require(goodbye.has_value(), Checker::answers, "GOODBYE cannot be read");
  around_.setting.trace.note("node {a} is told GOODBYE {b} on wire {c}", number_,
                             static_cast<std::uint64_t>(goodbye->code), wire->number);
  Link& from = links_.at(wire->number);
  from.told = goodbye->code;
  if (goodbye->code == GoodbyeCode::draining && from.welcomed)
    around_.setting.census.add(Happening::told_draining);
  if (wire != wire_) return;
  refusal_ = goodbye->code;
  was_kicked_ = goodbye->code == GoodbyeCode::kicked;
}

void SimNode::on_welcome(const WirePointer& wire, const proto::Welcome& welcome) {
  Link& to = links_.at(wire->number);
  require(!to.welcomed, Checker::seam, "a node is told WELCOME twice");
  to.welcomed = true;
  to.id = welcome.node;
  around_.setting.trace.note("node {a} is welcomed as {b}: {t}", number_, index_of(welcome.node), 0,
                             welcome.name);
  if (wire != wire_) return;
  // Those of another session are not replaced by this one.
  if (welcome.node != id_) {
    Link kept = std::move(to);
    links_.erase(wire->number);
    give_up_others();
    links_[wire->number] = std::move(kept);
    // With a token it may be the same session under another id, with all that it had subscribed to.
    if (token_.empty()) forgot_ = false;
  }
  // There may have been a connection between that the node knows nothing of. Subscriptions that
  // were not declared on it may have ended.
  link().same_session = std::exchange(session_, wire->session) == wire->session && dials_ == 1;
  dials_ = 0;
  token_ = welcome.token;
  id_ = welcome.node;
  registered_ = welcome.name;
  declare_again();
}

void SimNode::declare_again() {
  const std::map<std::string, Provided> provided = std::exchange(provides_, {});
  const std::map<std::string, Subscribed> subscribed = std::exchange(subscribes_, {});
  for (const auto& [service, what] : provided) {
    if (faulty() && around_.setting.random.chance(100)) continue;
    if (registered_.empty()) continue;
    ask(what.offer, about(service, what.offer));
  }
  for (const auto& [full_name, before] : subscribed) {
    if (faulty() && around_.setting.random.chance(100)) {
      forgot_ = true;
      continue;
    }
    if (link().same_session && !unsubscribing_.contains(full_name))
      link().before[full_name] = before.known;
    subscribe(before.wanted);
  }
  unsubscribing_.clear();
  if (wants_watch_) watch();
}

void SimNode::learn(NodeId node) {
  constexpr std::size_t kKnownMost = 24;
  if (node == id_ || index_of(node) == kHubIndex) return;
  if (known_.size() < kKnownMost) {
    known_.push_back(node);
  } else {
    around_.setting.random.pick(known_) = node;
  }
}

}  // namespace gimnet::sim
