#include "base/log.hpp"
#include "fuzz/hub/control/support/control_run.hpp"
#include "proto/control/ctrl.hpp"
#include "proto/control/ns_register.hpp"

// The requests of a run, read from the input.

namespace gimnet::fuzz {

using proto::Kind;
namespace ns = proto::ns;
namespace ctrl = proto::ctrl;

namespace {

std::string some_service(Choices& input) {
  constexpr std::string_view kServices[] = {"s0", "s1", "s2", "s3", "", "s/0"};
  const std::uint32_t choice = input.below(std::size(kServices) + 1);
  return choice < std::size(kServices) ? std::string{kServices[choice]} : some_name(input);
}

std::string some_metadata(Choices& input) {
  constexpr std::size_t kSizes[] = {0, 1, 7, 2'000, 4'096};
  return std::string(kSizes[input.below(std::size(kSizes))], 'm');
}

std::uint32_t some_records_max(Choices& input) {
  constexpr std::uint32_t kMost[] = {256, 1, 2, 0, UINT32_MAX};
  return kMost[input.below(std::size(kMost))];
}

}  // namespace

NodeId ControlRun::some_node(Choices& input) const {
  constexpr HubId kHubs[] = {ControlHub::kHub, ControlHub::kHub, kOwnHub, HubId{9}, kEveryHub};
  const HubId hub = kHubs[input.below(std::size(kHubs))];
  const std::uint8_t choice = input.byte();
  if (choice < 200) return make_id<NodeId>(hub, choice % 16);
  return make_id<NodeId>(hub, kEveryIndex - choice % 3);
}

GroupId ControlRun::some_group(Choices& input) const {
  constexpr HubId kHubs[] = {ControlHub::kHub, ControlHub::kHub, kOwnHub, HubId{9}};
  const HubId hub = kHubs[input.below(std::size(kHubs))];
  return make_id<GroupId>(hub, input.below(32));
}

void ControlRun::ask_names(Choices& input) {
  switch (input.below(6)) {
    case 0:
      return ask(input, Kind::ns, ns::RegisterName{some_name(input)});
    case 1:
      return ask(input, Kind::ns, ns::UnregisterName{});
    case 2:
      return ask(input, Kind::ns, ns::Resolve{some_name(input)});
    case 3:
      return ask(input, Kind::ns, ns::Reverse{some_node(input)});
    case 4: {
      ns::List list;
      list.pattern = some_pattern(input);
      list.after = some_node(input);
      list.records_max = some_records_max(input);
      list.connected_only = (list.after.value() & 1) != 0;
      return ask(input, Kind::ns, list);
    }
    default: {
      ns::Services list;
      list.pattern = some_pattern(input);
      list.after = some_group(input);
      list.records_max = some_records_max(input);
      return ask(input, Kind::ns, list);
    }
  }
}

void ControlRun::ask_services(Choices& input) {
  switch (input.below(4)) {
    case 0:
      return advertise(input);
    case 1:
      return ask(input, Kind::ns, ns::Withdraw{some_group(input)});
    case 2:
      return subscribe(input);
    default: {
      const std::string node = some_name(input);
      return ask(input, Kind::ns, ns::Unsubscribe{node + "/" + some_service(input)});
    }
  }
}

/// Mostly what its provider would show, without taking anything of the input.
std::vector<std::byte> ControlRun::some_proof(std::uint32_t group) {
  if (group % 8 == 7) return {};
  return group % 8 == 6 ? reference_.latest_proof() : reference_.proof_of(group);
}

void ControlRun::advertise(Choices& input) {
  ns::Advertise offer;
  offer.service = some_service(input);
  const std::uint8_t terms = input.byte();
  offer.message_type = terms & 1;
  offer.retain = (terms & 2) != 0;
  offer.delivery = static_cast<ns::Delivery>((terms >> 2 & 3) % 3);
  offer.direction = (terms & 0x70) == 0x70 ? ns::Direction::accepts : ns::Direction::provides;
  offer.instance = terms >> 7;
  if (offer.delivery == ns::Delivery::sync || (terms & 0x70) == 0x10)
    offer.window = input.below(10);
  offer.metadata = some_metadata(input);
  offer.former_group = some_group(input);
  offer.former_proof = some_proof(index_of(offer.former_group));
  ask(input, Kind::ns, offer);
}

void ControlRun::subscribe(Choices& input) {
  constexpr double kRates[] = {0.0, 1.0, 1'000.0, 0.001, 0.0009, 1'000.5, -1.0, 3.0};
  ns::Subscribe wanted;
  wanted.name = some_name(input) + "/" + some_service(input);
  const std::uint8_t terms = input.byte();
  wanted.window = (terms & 15) < 10 ? 0 : (terms & 15) - 8;
  wanted.depth = (terms & 0x80) != 0 ? input.below(6) : 1;
  wanted.rate_hz = kRates[(terms >> 4 & 7)];
  ask(input, Kind::ns, wanted);
}

void ControlRun::ask_watches(Choices& input) {
  switch (input.below(4)) {
    case 0:
    case 1:
      return watch(input);
    case 2:
      return ask(input, Kind::ns, ns::Unwatch{input.below(4)});
    default:
      return ask(input, Kind::ns, ns::WatchTaken{input.below(4), input.below(8)});
  }
}

void ControlRun::watch(Choices& input) {
  const hub::Journal& journal = hub_.conductor.watches().journal();
  ns::Watch wanted;
  const std::uint8_t choice = input.byte();
  wanted.watch = choice & 3;
  wanted.subjects = static_cast<std::uint8_t>(choice >> 2 & 3);
  wanted.pattern = some_pattern(input);
  if ((choice & 16) != 0) {
    // It goes on where it says it is: a little behind, at the end, or beyond it.
    const std::uint64_t behind = input.below(16);
    wanted.epoch = journal.epoch() + ((choice & 0xE0) == 0xE0 ? 1 : 0);
    wanted.version = behind == 15 ? journal.version() + 1
                                  : journal.version() - std::min(behind, journal.version());
  }
  ask(input, Kind::ns, wanted);
}

/// Bytes that nobody who keeps to the protocol sends.
void ControlRun::ask_anything(Choices& input) {
  constexpr Kind kKinds[] = {Kind::ns, Kind::ns, Kind::ctrl, Kind::route};
  constexpr std::uint32_t kDestinations[] = {
      0, 0, 0, 7u << kIndexBits, (7u << kIndexBits) + 3, 9u << kIndexBits};
  const Kind kind = kKinds[input.below(std::size(kKinds))];
  const NodeId dst{kDestinations[input.below(std::size(kDestinations))]};
  const Line* line = pick(input);
  const auto bytes = input.bytes(input.byte());
  // RELOAD would have nothing to read here, and LOG_LEVEL would have this program speak.
  if (const auto view = proto::split_control(bytes); view && kind == Kind::ctrl) {
    const bool apart = view->header.operation == ctrl::Reload::kOperation ||
                       view->header.operation == ctrl::SetLogLevel::kOperation;
    if (apart) return;
  }
  if (line != nullptr) ask(*line, kind, bytes, dst);
}

void ControlRun::ask_control(Choices& input) {
  switch (input.below(4)) {
    case 0:
      return ask(input, Kind::ctrl, ctrl::HubInfo{});
    case 1:
      return ask(input, Kind::ctrl, ctrl::Statistics{});
    case 2:
      return ask(input, Kind::ctrl, ctrl::Routes{});
    default: {
      const NodeId after = some_node(input);
      return ask(input, Kind::ctrl, ctrl::Connections{after, some_records_max(input)});
    }
  }
}

void ControlRun::administer(Choices& input) {
  switch (input.below(6)) {
    case 0:
    case 1: {
      const NodeId node = some_node(input);
      return ask(input, Kind::ctrl, ctrl::Kick{node, some_metadata(input).substr(0, 256)});
    }
    case 2:
    case 3: {
      const NodeId node = some_node(input);
      return ask(input, Kind::ctrl, ctrl::Reassign{node, some_node(input)});
    }
    case 4:
      return reload(input);
    default:
      return set_level(input);
  }
}

hub::Reloading ControlRun::some_configuration(Choices& input) const {
  constexpr std::uint64_t hub::Limits::* kLimits[] = {&hub::Limits::nodes,
                                                      &hub::Limits::services_per_node,
                                                      &hub::Limits::subscriptions_per_node,
                                                      &hub::Limits::watches,
                                                      &hub::Limits::watches_per_node,
                                                      &hub::Limits::page_records,
                                                      &hub::Limits::sync_window,
                                                      &hub::Limits::token_ms,
                                                      &hub::Limits::subscription_depth,
                                                      &hub::Limits::requests,
                                                      &hub::Limits::handshakes,
                                                      &hub::Limits::declarations_per_s,
                                                      &hub::Limits::declarations_burst,
                                                      &hub::Limits::oddities_per_s,
                                                      &hub::Limits::oddities_burst};
  hub::Reloading found;
  found.limits = reference_.limits();
  // Without a word of its own in the log: reading anew says something at `info`.
  found.log_level = input.below(2) == 0 ? LogLevel::off : LogLevel::error;
  for (std::uint32_t changes = input.below(4); changes > 0; --changes) {
    std::uint64_t& limit = found.limits.*kLimits[input.below(std::size(kLimits))];
    const std::uint64_t from = limit;
    limit = 1 + input.below(6);
    found.changes.push_back({"limits.some", std::to_string(from), std::to_string(limit), false});
  }
  if (input.below(3) == 0) found.faults.emplace_back("hub.toml:1:1: something is wrong");
  return found;
}

void ControlRun::reload(Choices& input) {
  const hub::Reloading found = some_configuration(input);
  hub_.read_again = [found] { return found; };
  reference_.expect_reload(found);
  ask(input, Kind::ctrl, ctrl::Reload{});
  if (hub_.all<hub::LimitsCommand>().empty()) return;
  FUZZ_MUST(log_level() == reference_.level());
  set_log_level(LogLevel::off);
}

void ControlRun::set_level(Choices& input) {
  constexpr std::string_view kLevels[] = {"error", "warning", "info", "debug", "off", "loud", ""};
  const std::string level{kLevels[input.below(std::size(kLevels))]};
  set_log_level(reference_.level());
  ask(input, Kind::ctrl, ctrl::SetLogLevel{level});
  FUZZ_MUST(log_level() == reference_.level());
  set_log_level(LogLevel::off);
}

void ControlRun::drain() {
  if (!reference_.drain_wanted()) return;
  hub_.drain();
  reference_.draining();
  const std::size_t told = hub_.all<hub::DrainCommand>().size();
  FUZZ_MUST(told == 0 || told == ControlHub::kShards);
  compare();
  if (told == 0) return;
  for (std::size_t shard = 0; shard < ControlHub::kShards; ++shard) {
    FUZZ_MUST(!hub_.conductor.drained());
    hub_.drained(shard);
    compare();
  }
  FUZZ_MUST(hub_.conductor.drained());
}

}  // namespace gimnet::fuzz
