#include "tests/sim/hubs/sim_node.hpp"

#include <iterator>
#include <utility>

#include "base/endian.hpp"
#include "proto/control/ns.hpp"
#include "proto/control/ns_register.hpp"
#include "proto/frame/report.hpp"

namespace gimnet::sim::hubs {
namespace {

namespace ns = proto::ns;
using proto::Kind;
using proto::Lane;

/// A request that another hub does not answer is answered by the own hub after 5 s, on a clock that
/// may have stood still. Two frames ahead of it may have waited for room, 5 s each.
constexpr milliseconds kAnswerMost{19'000};
/// A node is heard of though the hub has no reason to ask.
constexpr milliseconds kSpeaksEvery{1'000};
constexpr milliseconds kPauseOfAnotherHub{1'000};
constexpr std::size_t kAskedMost = 16;
constexpr std::size_t kWantedMost = 4;
/// Nodes that some others want the service of have one of so many first names.
constexpr std::uint64_t kGiversMost = 12;
constexpr const char* kGiven = "gives";
constexpr std::uint64_t kSmallBytes = 100;
constexpr std::uint64_t kLargeBytes = 20'000;
/// dst of a BROADCAST to all hubs.
constexpr std::uint32_t kEverybody = 0xFFFF'FFFF;

}  // namespace

void SimNode::step(SimHub* hub, milliseconds now, std::uint64_t says_every) {
  now_ = now;
  if (!up_) {
    if (now < back_at_) return;
    if (hub != nullptr) return join(*hub, now);
    if (plan_.moves()) move(now);
    return;
  }
  read(now);
  std::erase_if(paused_, [now](const auto& each) { return each.second && *each.second <= now; });
  if (!is_up()) return;
  if (now % kSpeaksEvery == milliseconds{0}) say_flow(proto::flow::Pong{});
  if (says_every != 0 && now >= say_at_) {
    say_at_ = now + milliseconds{around_.random.between(1, 2 * says_every)};
    say();
  }
  if (!asked_.empty() && now - asked_.begin()->second.at > kAnswerMost)
    broken(Checker::answered, "a request of node " + plan_.name + " is never answered");
}

void SimNode::join(SimHub& hub, milliseconds now) {
  auto [stream, peer] = hub::make_memory_pipe();
  pipe_ = std::move(peer);
  stream_.clear();
  opened_ = welcomed_ = false;
  paused_.clear();
  asked_.clear();
  given_.reset();
  accepts_ = false;
  followed_.clear();
  hub::Stranger stranger;
  stranger.transport = std::move(stream);
  stranger.peer = {"unix", plan_.name};
  stranger.identity = hub::Identity::of_user(administers_ ? 0 : 1'000);
  stranger.rights.administer = administers_;
  proto::Hello hello;
  hello.role = administers_ ? proto::Role::admin : proto::Role::node;
  hello.token = token_;
  if (!token_.empty()) hello.former = id_;
  if (wants_name_) hello.name = plan_.name;
  const auto refused = hub.admit(std::move(stranger), pipe_, hello, now);
  back_at_ = now + milliseconds{around_.random.between(50, 500)};
  if (refused) {
    around_.census.note(Event::refused_name);
    last_ = "was refused at " + std::to_string(now.count()) + ": " + refused->sentence;
    if (plan_.moves()) return;
    token_.clear();
    wants_name_ = around_.random.chance(500);
    return;
  }
  wants_name_ = true;
  up_ = true;
  // One that is to be let go elsewhere first learns its id by WELCOME.
  waits_ = hub.admitted().node == NodeId{};
  if (!waits_) begin_session(hub.admitted().node, hub.admitted().new_session);
}

void SimNode::begin_session(NodeId id, bool new_session) {
  if (!token_.empty() && hub_of(id) != hub_of(id_)) around_.census.note(Event::moved);
  // A hub that was started again knows the session no more, and its token gives the id back.
  const bool same = id_ == id && !token_.empty();
  id_ = id;
  session_ = around_.book.note_session(at_, id_, !same);
  if (new_session) group_.reset();
}

void SimNode::move_to(std::size_t hub, milliseconds now) {
  at_ = hub;
  up_ = false;
  last_ = "moved at " + std::to_string(now.count());
  back_at_ = now + milliseconds{around_.random.between(1, 50)};
}

void SimNode::crash(milliseconds now) {
  if (!up_) return;
  around_.census.note(Event::node_crashed);
  if (around_.random.chance(500)) {
    pipe_.close();
  } else {
    pipe_.reset();
  }
  up_ = false;
  last_ = "crashed at " + std::to_string(now.count());
  if (around_.random.chance(500)) token_.clear();
  back_at_ = now + milliseconds{around_.random.between(1, 2'000)};
}

void SimNode::lose_connection(milliseconds now, std::uint64_t back_after_ms) {
  pipe_.reset();
  up_ = false;
  last_ = "lost its connection at " + std::to_string(now.count());
  back_at_ = now + milliseconds{back_after_ms};
}

void SimNode::read(milliseconds now) {
  const std::size_t most =
      plan_.reads_per_ms == 0 ? hub::MemoryPeer::kAll : std::size_t{plan_.reads_per_ms};
  if (plan_.reads_per_ms != 0) pipe_.set_room(4'096);
  const bool gone = pipe_.transport_gone();
  const bool more = pipe_.read(stream_, most) != 0;
  std::size_t next = 0;
  if (!opened_ && stream_.size() >= proto::kOpeningSize) {
    opened_ = true;
    next = proto::kOpeningSize;
  }
  while (opened_ && stream_.size() - next >= proto::kHeaderSize) {
    const proto::FrameHeader header = proto::load_header(stream_.data() + next);
    if (stream_.size() - next < header.frame_size()) break;
    take(header, std::span(stream_).subspan(next + proto::kHeaderSize, header.length));
    next += header.frame_size();
  }
  stream_.erase(stream_.begin(), stream_.begin() + static_cast<std::ptrdiff_t>(next));
  if (!gone || more) return;
  last_ = "lost its connection at " + std::to_string(now.count()) + goodbye_;
  up_ = false;
  back_at_ = now + milliseconds{around_.random.between(20, 500)};
}

void SimNode::take(const proto::FrameHeader& header, std::span<const std::byte> payload) {
  if (header.kind == Pictures::kKind) return pictures_.take(payload, now_);
  switch (header.kind) {
    case Kind::unicast:
    case Kind::service: {
      const std::uint32_t own =
          header.kind == Kind::unicast ? id_.value() : group_.value_or(GroupId{}).value();
      if (header.dst != own) broken(Checker::right_node, "a node gets a frame for another id");
      ++taken_;
      return around_.book.note_arrived(payload, session_);
    }
    case Kind::group:
      if (administers_ && payload.size() >= Book::kNumberBytes)
        heard_[GroupId{header.dst}].push_back(load_le<std::uint64_t>(payload.data()));
      return;
    case Kind::broadcast:
      return broadcasts_.push_back(load_le<std::uint64_t>(payload.data()));
    case Kind::flow:
      return take_flow(payload);
    case Kind::report:
      around_.census.note(Event::no_route);
      if (const auto report = proto::decode_report(payload)) {
        reported_ += report->count;
        first_report_.try_emplace(report->reason, now_);
      }
      return;
    case Kind::link:
      if (const auto welcome = proto::decode<proto::Welcome>(payload)) {
        welcomed_ = true;
        if (std::exchange(waits_, false)) begin_session(welcome->node, true);
        name_ = welcome->name;
        token_ = welcome->token;
        if (administers_) return;
        if (around_.random.chance(400)) offer();
        gives_ = gives_ || around_.random.chance(150);
        if (gives_) give();
        for (const std::string& each : std::set<std::string>(wanted_)) subscribe(each);
      } else if (const auto goodbye = proto::decode<proto::Goodbye>(payload)) {
        goodbye_ = ": " + goodbye->sentence;
      }
      return;
    default:
      return take_control(payload);
  }
}

void SimNode::say_flow(const proto::flow::Message& message) {
  std::byte bytes[proto::flow::kFrameSizeMax];
  pipe_.write({bytes, proto::flow::encode_frame(message, id_, bytes)});
}

void SimNode::take_flow(std::span<const std::byte> payload) {
  const auto message = proto::flow::decode(payload);
  if (!message) return;
  if (const auto* ping = std::get_if<proto::flow::Ping>(&*message)) {
    say_flow(proto::flow::Pong{ping->sequence, ping->sent_ns, ping->sent_ns});
  } else if (const auto* pause = std::get_if<proto::flow::Pause>(&*message)) {
    around_.census.note(Event::paused_sender);
    const bool elsewhere = hub_of(NodeId{pause->target.dst}) != hub_of(id_);
    paused_[{pause->target.kind, pause->target.lane, pause->target.dst}] =
        elsewhere ? std::optional{now_ + kPauseOfAnotherHub} : std::nullopt;
  } else if (const auto* resume = std::get_if<proto::flow::Resume>(&*message)) {
    paused_.erase({resume->target.kind, resume->target.lane, resume->target.dst});
  }
}

void SimNode::take_control(std::span<const std::byte> payload) {
  const auto view = proto::split_control(payload);
  if (!view) return;
  if (!view->header.is_answer()) {
    if (const auto moved = proto::decode<ns::ServiceMoved>(payload)) {
      if (followed_.contains(moved->name)) followed_[moved->name] = *moved;
      return;
    }
    const auto lost = proto::decode<ns::NameLost>(payload);
    if (!lost) return;
    around_.census.note(Event::lost_name);
    if (lost->name == name_) name_.clear();
    return;
  }
  const auto found = asked_.find(view->header.request);
  if (found == asked_.end())
    broken(Checker::answered, "node " + plan_.name + " gets an answer that it did not ask for");
  const std::string name = found->second.name;
  const bool gives = found->second.gives;
  if (const std::string follows = found->second.follows; !follows.empty()) {
    if (const auto state = proto::decode_answer<ns::SubscribeAnswer>(payload))
      followed_[follows] = *state;
  }
  asked_.erase(found);
  if (const auto offered = proto::decode_answer<ns::AdvertiseAnswer>(payload)) {
    if (gives) return void(given_ = offered->group);
    group_ = offered->group;
    accepts_ = true;
    return around_.book.note_group(offered->group, session_);
  }
  if (const auto listed = proto::decode_answer<ns::ServicesAnswer>(payload)) {
    for (const ns::ServiceRecord& each : listed->services)
      missed_[each.group] = {each.missed, each.missed_most};
  }
  if (name.empty()) return;
  const auto answer = proto::decode_answer<ns::ResolveAnswer>(payload);
  const bool held = answer && answer->standing == ns::NameStanding::held;
  resolved_[name] = held ? answer->node : NodeId{};
}

void SimNode::say() {
  Random& random = around_.random;
  const std::uint64_t choice = random.below(100);
  const std::uint64_t bytes =
      Book::kNumberBytes + random.below(random.chance(30) ? kLargeBytes : kSmallBytes);
  const proto::Policy policy = random.chance(800) ? proto::Policy::block : proto::Policy::drop;
  if (choice < 10) return ask_something();
  if (choice < 14) {
    if (wanted_.size() < kWantedMost) subscribe("n" + std::to_string(random.below(kGiversMost)));
    return;
  }
  if (choice < 24 && given_) return void(publish());
  if (choice < 34 && !around_.book.groups().empty()) {
    auto entry = around_.book.groups().begin();
    std::advance(entry, static_cast<std::ptrdiff_t>(random.below(around_.book.groups().size())));
    // Nobody knows who has it by then.
    static_cast<void>(send(Kind::service, entry->first.value(), 0, bytes, policy));
    return;
  }
  const auto& known = around_.book.known();
  const NodeId to = random.pick(known);
  if (to == id_) return;
  static_cast<void>(send(Kind::unicast, to.value(), around_.book.session_of(to), bytes, policy));
}

void SimNode::ask_something() {
  const NodeId other = around_.random.pick(around_.book.known());
  if (asked_.size() >= kAskedMost) return;
  around_.census.note(Event::asked_another_hub);
  resolve(plan_.name, around_.random.chance(700) ? hub_of(other) : HubId{});
}

void SimNode::offer() {
  if (name_.empty()) return;
  ns::Advertise advertise;
  advertise.service = kTaken;
  advertise.direction = ns::Direction::accepts;
  ++last_request_;
  ask(Kind::ns, proto::encode(advertise, last_request_), last_request_, {});
}

void SimNode::give() {
  if (name_.empty()) return;
  ns::Advertise advertise;
  advertise.service = kGiven;
  advertise.retain = true;
  ++last_request_;
  ask(Kind::ns, proto::encode(advertise, last_request_), last_request_, {});
  asked_[last_request_].gives = true;
}

std::uint64_t SimNode::publish() {
  std::vector<std::byte> payload(Book::kNumberBytes);
  store_le(payload.data(), ++published_);
  write(Kind::group, given_->value(), payload);
  return published_;
}

void SimNode::subscribe(const std::string& node) {
  wanted_.insert(node);
  ++last_request_;
  ask(Kind::ns, proto::encode(ns::Subscribe{node + "/" + kGiven}, last_request_), last_request_,
      {});
}

void SimNode::say_missed(GroupId group, std::uint64_t total) {
  say_flow(proto::flow::Missed{group, total});
}

void SimNode::list_service(const std::string& node) {
  ns::ServicesRequest request;
  request.pattern = node + "/" + kGiven;
  ++last_request_;
  ask(Kind::ns, proto::encode(request, last_request_), last_request_, {});
}

void SimNode::follow(const std::string& node) {
  const std::string full_name = node + "/" + kTaken;
  ++last_request_;
  ask(Kind::ns, proto::encode(ns::Subscribe{full_name}, last_request_), last_request_, {});
  asked_[last_request_].follows = full_name;
}

void SimNode::resolve(const std::string& name, HubId hub) {
  ++last_request_;
  ask(Kind::ns, proto::encode(ns::Resolve{name}, last_request_), last_request_, hub);
  asked_[last_request_].name = name;
}

void SimNode::ask(Kind kind, const proto::Payload& payload, std::uint16_t request, HubId hub) {
  asked_[request] = {now_, {}};
  write(kind, hub == HubId{} ? 0 : make_id<NodeId>(hub, kHubIndex).value(), payload);
}

std::optional<std::uint64_t> SimNode::send_to(NodeId to, std::uint64_t bytes) {
  if (bytes == 0) bytes = Book::kNumberBytes + around_.random.below(kSmallBytes);
  return send(Kind::unicast, to.value(), around_.book.session_of(to), bytes, proto::Policy::block);
}

void SimNode::broadcast(std::uint64_t number) {
  std::vector<std::byte> payload(Book::kNumberBytes);
  store_le(payload.data(), number);
  write(Kind::broadcast, kEverybody, payload);
}

void SimNode::show(NodeId to, std::uint32_t bytes) {
  constexpr auto kFlags =
      static_cast<std::uint8_t>(proto::Policy::latest) | unsigned{proto::kFlagFragment};
  for (const auto& frame : pictures_.cut(bytes, now_))
    write(Pictures::kKind, to.value(), frame, static_cast<std::uint8_t>(kFlags));
}

std::optional<std::uint64_t> SimNode::send(Kind kind, std::uint32_t dst, std::uint64_t session,
                                           std::uint64_t bytes, proto::Policy policy) {
  if (plan_.heeds_pause && paused_.contains({kind, Lane::normal, dst})) return std::nullopt;
  const std::uint64_t number = around_.book.note_sent(at_, session);
  std::vector<std::byte> payload(static_cast<std::size_t>(bytes));
  store_le(payload.data(), number);
  const auto flags = static_cast<std::uint8_t>(policy) | unsigned{proto::kFlagReport};
  write(kind, dst, payload, static_cast<std::uint8_t>(flags));
  return number;
}

void SimNode::write(Kind kind, std::uint32_t dst, std::span<const std::byte> payload,
                    std::uint8_t flags) {
  proto::FrameHeader header;
  header.length = static_cast<std::uint32_t>(payload.size());
  header.dst = dst;
  header.src = id_.value();
  header.kind = kind;
  header.flags = flags;
  header.lane = static_cast<std::uint8_t>(Lane::normal);
  std::vector<std::byte> bytes(proto::kHeaderSize);
  proto::store_header(bytes.data(), header);
  bytes.insert(bytes.end(), payload.begin(), payload.end());
  pipe_.write(bytes);
}

}  // namespace gimnet::sim::hubs
