#include "fuzz/hub/control/support/control_run.hpp"

#include <algorithm>

#include "base/log.hpp"
#include "proto/control/ns_register.hpp"

namespace gimnet::fuzz {

using proto::GoodbyeCode;
using proto::Kind;
namespace ns = proto::ns;

namespace {

/// Each step is compared whole, so that longer runs find no more, but later.
constexpr std::size_t kStepsMax = 150;
constexpr std::size_t kLinesMax = 12;
constexpr std::size_t kTokensMax = 32;
constexpr std::size_t kRoundsMax = 10'000;

/// Small, so that a short input reaches them.
hub::Limits limits_for(std::uint8_t choice) {
  hub::Limits limits;
  limits.grace_ms = 1'000;
  limits.block_ms = 300;
  limits.slow_consumer_ms = 500;
  limits.token_ms = (choice & 1) != 0 ? 2'500 : 60'000;
  limits.nodes = (choice & 2) != 0 ? 4 : 8;
  limits.administrators = 1;
  limits.services_per_node = limits.subscriptions_per_node = (choice & 4) != 0 ? 2 : 5;
  limits.watches = (choice & 8) != 0 ? 3 : 10;
  limits.watches_per_node = (choice & 8) != 0 ? 2 : 10;
  limits.page_records = (choice & 16) != 0 ? 2 : 256;
  limits.scan_records = (choice & 32) != 0 ? 3 : 4'096;
  limits.watch_changes = (choice & 64) != 0 ? 6 : 65'536;
  limits.sync_window = 8;
  limits.subscription_depth = 4;
  if ((choice & 128) != 0) {
    limits.declarations_burst = limits.oddities_burst = 3;
    limits.declarations_per_s = 2;
    limits.oddities_per_s = 1;
  }
  return limits;
}

}  // namespace

std::string some_name(Choices& input) {
  constexpr std::string_view kNames[] = {"a", "b", "a/b", "a/b/c", "d", "", "a/*", "a//b"};
  const std::uint32_t choice = input.below(std::size(kNames) + 2);
  if (choice < std::size(kNames)) return std::string{kNames[choice]};
  const auto bytes = input.bytes(input.byte());
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

std::string some_pattern(Choices& input) {
  constexpr std::string_view kPatterns[] = {"",      "**",    "*",     "a/**", "a",
                                            "*/b/*", "**/s1", "a/b/*", "a/"};
  const std::uint32_t choice = input.below(std::size(kPatterns) + 1);
  return choice < std::size(kPatterns) ? std::string{kPatterns[choice]} : some_name(input);
}

ControlRun::ControlRun(Choices& input) : hub_(limits_for(input.byte())), reference_(hub_.limits) {
  set_log_level(LogLevel::off);
}

void ControlRun::of_input(const std::uint8_t* data, std::size_t size, Step step) {
  Choices choices(input(data, size));
  ControlRun run(choices);
  for (std::size_t steps = 0; choices.left() && steps < kStepsMax; ++steps) step(run, choices);
  run.finish();
}

void ControlRun::compare() { reference_.compare(hub_); }

Line* ControlRun::pick(Choices& input) {
  const std::uint8_t choice = input.byte();
  if (lines_.empty()) return nullptr;
  Line& line = lines_[choice % lines_.size()];
  // A connection that ended says nothing more, but what a replaced one said may still be under way.
  const auto session = reference_.sessions().find(line.session);
  const bool over =
      session == reference_.sessions().end() || session->second.attachment != line.attachment;
  return line.open || over ? &line : nullptr;
}

// ---- joining and leaving

void ControlRun::keep_token(const std::vector<std::byte>& token) {
  FUZZ_MUST(!token.empty());
  tokens_.push_back(token);
  if (tokens_.size() > kTokensMax) tokens_.erase(tokens_.begin());
}

void ControlRun::join(Choices& input) {
  Stranger stranger;
  stranger.hello.name = some_name(input);
  const std::uint8_t how = input.byte();
  constexpr proto::Role kRoles[] = {proto::Role::node,  proto::Role::node,  proto::Role::node,
                                    proto::Role::admin, proto::Role::admin, proto::Role::hub,
                                    proto::Role{77},    proto::Role::node};
  stranger.hello.role = kRoles[how & 7];
  stranger.may_administer = (how & 8) == 0;
  stranger.identity = (how & 16) != 0 ? "uid 1000" : "open";
  stranger.hello.description = (how & 32) != 0 ? "a description" : "";
  stranger.hello.resume = (how & 32) != 0;
  if ((how & 64) != 0 && !tokens_.empty()) {
    stranger.hello.token = tokens_[input.byte() % tokens_.size()];
    const std::uint8_t bit = (how & 128) != 0 ? input.byte() : 0;
    if ((how & 128) != 0) stranger.hello.token[bit % stranger.hello.token.size()] ^= std::byte{1};
  }
  take_in(stranger);
}

void ControlRun::take_in(const Stranger& who) {
  Stranger stranger = who;
  stranger.place = "10.0.0.1:" + std::to_string(++strangers_);
  const std::optional<proto::Goodbye> refusal = hub_.admit(stranger);
  const std::uint64_t session = reference_.came(stranger, hub_, refusal);
  compare();
  if (session == 0) return;
  const auto attached = hub_.all<hub::AttachCommand>();
  const hub::AttachCommand& attach = *attached.front().second;
  for (Line& line : lines_) {
    // A newer connection fences the earlier one, of whose end nothing is heard.
    if (line.session == session) line.open = false;
  }
  Line line;
  line.session = session;
  line.node = attach.node;
  line.seat = reference_.sessions().at(session).seat;
  line.attachment = attach.attachment;
  line.open = true;
  keep_token(attach.welcome.token);
  lines_.push_back(line);
  if (lines_.size() <= kLinesMax) return;
  const auto closed =
      std::find_if(lines_.begin(), lines_.end(), [](const Line& each) { return !each.open; });
  if (closed != lines_.end()) lines_.erase(closed);
}

void ControlRun::end(Choices& input) {
  constexpr GoodbyeCode kCodes[] = {GoodbyeCode::done,         GoodbyeCode::done,
                                    GoodbyeCode::silent,       GoodbyeCode::malformed,
                                    GoodbyeCode::not_allowed,  GoodbyeCode::too_many_requests,
                                    GoodbyeCode::wrong_source, GoodbyeCode::draining};
  const std::uint8_t how = input.byte();
  Line* line = pick(input);
  if (line == nullptr) return;
  // Without a code of its own (1), a connection broke; with the peer's (0), it said GOODBYE.
  const GoodbyeCode code = line->told.value_or(kCodes[how & 7]);
  const bool said_by_peer = !line->told && ((how & 7) == 0 || (how & 8) != 0);
  hub_.end(*line, said_by_peer, code);
  reference_.ended(*line, said_by_peer, code, hub_);
  line->open = false;
  compare();
}

/// What a shard was told to close ends before anything that takes time.
void ControlRun::hear_of_ends() {
  for (Line& line : lines_) {
    if (!line.open || !line.told) continue;
    hub_.end(line, false, *line.told);
    reference_.ended(line, false, *line.told, hub_);
    line.open = false;
    compare();
  }
}

void ControlRun::pass(Choices& input) {
  constexpr int kTimes[] = {1, 50, 400, 1'000, 1'600, 3'000};
  const milliseconds time{kTimes[input.below(std::size(kTimes))]};
  hear_of_ends();
  hub_.pass(time);
  reference_.passed(hub_);
  compare();
}

// ---- asking

void ControlRun::ask(const Line& line, Kind kind, std::span<const std::byte> payload, NodeId dst) {
  const std::optional<proto::Payload> answer = hub_.ask(line, kind, payload, dst);
  reference_.asked(line, kind, payload, dst, answer, hub_);
  compare();
  if (answer && kind == Kind::ns) note_tokens(*answer);
  for (Line& each : lines_) {
    for (const auto& [shard, close] : hub_.all<hub::CloseCommand>()) {
      const Seat seat{shard, close->session.slot.value(), close->session.generation};
      if (each.seat == seat) each.told = close->code;
    }
    for (const auto& [shard, renumber] : hub_.all<hub::RenumberCommand>()) {
      const Seat seat{shard, renumber->session.slot.value(), renumber->session.generation};
      if (each.seat == seat) each.told = GoodbyeCode::renumbered;
    }
  }
}

void ControlRun::note_tokens(std::span<const std::byte> answer) {
  if (const auto named = proto::decode_answer<ns::RegisterNameAnswer>(answer))
    keep_token(named->token);
  if (const auto nameless = proto::decode_answer<ns::UnregisterNameAnswer>(answer))
    keep_token(nameless->token);
}

// ---- watches

bool ControlRun::serve_once() {
  const bool more = hub_.serve();
  reference_.served(hub_);
  compare();
  return more;
}

void ControlRun::serve(Choices& input) {
  if (input.below(4) == 0) return settle();
  static_cast<void>(serve_once());
}

/// Those who watch take what they are told until there is nothing more to tell.
void ControlRun::settle() {
  for (std::size_t round = 0;; ++round) {
    FUZZ_MUST(round < kRoundsMax);
    bool moved = serve_once() || !hub_.shards.sent.empty();
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      const Line line = lines_[i];
      const auto session = reference_.sessions().find(line.session);
      if (!line.open || session == reference_.sessions().end() ||
          session->second.attachment != line.attachment) {
        continue;
      }
      std::vector<ns::WatchTaken> taken;
      for (const auto& [number, view] : session->second.watches) {
        if (view.under_way() != 0) taken.push_back({number, view.under_way()});
      }
      for (const ns::WatchTaken& each : taken) ask(line, Kind::ns, proto::encode(each, ++request_));
      moved = moved || !taken.empty();
    }
    if (!moved) break;
  }
  reference_.require_agreed_watches();
}

void ControlRun::finish() {
  hear_of_ends();
  settle();
  for (Line& line : lines_) {
    if (!line.open) continue;
    hub_.end(line, true, GoodbyeCode::done);
    reference_.ended(line, true, GoodbyeCode::done, hub_);
    line.open = false;
    compare();
  }
  hub_.pass(milliseconds{100'000});
  reference_.passed(hub_);
  compare();
  FUZZ_MUST(reference_.sessions().empty() && reference_.groups().empty());
  FUZZ_MUST(hub_.conductor.membership().services().topics() == 0 &&
            hub_.conductor.watches().size() == 0);
}

}  // namespace gimnet::fuzz
