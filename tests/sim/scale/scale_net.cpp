#include "tests/sim/scale/scale_net.hpp"

#include <malloc.h>

#include <algorithm>
#include <string>

#include "base/check.hpp"
#include "proto/control/route.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::sim::scale {
namespace {

namespace route = proto::route;

constexpr std::uint64_t kOpenWithinMs = 50;
constexpr std::int64_t kKeepAliveMs = 250;
/// Longer than any pause of a hub that has something to say.
constexpr milliseconds kQuiet{1'500};
constexpr milliseconds kGiveUp{120'000};
constexpr milliseconds kIdle{1'000};
constexpr std::size_t kNamesBytesMax = std::size_t{4} << 30;

std::uint64_t memory_now() {
  const struct mallinfo2 info = ::mallinfo2();
  return info.uordblks + info.hblkhd;
}

std::uint64_t keep_alive_bytes() {
  constexpr std::int64_t kTime = 1'700'000'000'000'000'000;
  static const std::uint64_t kBytes =
      proto::kHeaderSize + proto::encode(route::KeepAlive{kTime, kTime, kTime, 0, ~0ull}).size();
  return kBytes;
}

bool changes_names(const proto::Payload& bytes) {
  const auto view = proto::split_control(bytes);
  return view && view->header.operation == static_cast<std::uint16_t>(route::RouteOperation::names);
}

}  // namespace

ScaleNet::ScaleNet(const Shape& shape, std::uint64_t seed) : shape_(shape), random_(seed) {
  hubs_.resize(shape_.hubs);
  ends_of_.resize(shape_.hubs);
  for (const Pair& pair : shape_.links) {
    Link link;
    const std::size_t ends[] = {pair.first, pair.second};
    for (int end = 0; end < 2; ++end) {
      auto& of = ends_of_[ends[end]];
      of.emplace_back(links_.size(), end);
      link.ends[end] = {ends[end], hub::LinkNumber{static_cast<std::uint32_t>(of.size())}, false};
    }
    links_.push_back(link);
  }
}

void ScaleNet::add_hub(std::size_t index) {
  Hub& each = hubs_[index];
  each.whole = shape_.whole == 0 || index < shape_.whole;
  hub::HubIdentity self;
  self.key.hub = HubId{static_cast<std::uint16_t>(index + 1)};
  for (std::uint8_t& byte : self.key.unique.bytes)
    byte = static_cast<std::uint8_t>(random_.below(256));
  self.instance = proto::HubInstance{random_.next()};
  self.configured = true;
  each.state = std::make_unique<hub::NetworkState>(
      self, hub::HubWords{"robot" + std::to_string(index), "0.1.0"});
  each.due = now_;
  if (shape_.names == 0) return;
  hub::NameCopies::Options options{{self.key.hub, self.instance}};
  options.bytes_max = kNamesBytesMax;
  each.names = std::make_unique<hub::NameExchange>(options);
  put_names(index);
}

void ScaleNet::put_names(std::size_t index) {
  for (std::size_t i = 1; i <= shape_.names; ++i) {
    route::NameClaim claim;
    claim.node = make_id<NodeId>(HubId{static_cast<std::uint16_t>(index + 1)},
                                 static_cast<std::uint32_t>(i));
    hubs_[index].names->put_own("robot" + std::to_string(index) + "/part" + std::to_string(i),
                                claim);
  }
}

void ScaleNet::open(std::size_t link) {
  links_[link].up = true;
  begin(link, 0);
}

/// The side that dialled begins, the other one when something comes.
void ScaleNet::begin(std::size_t link, int end) {
  Link& each = links_[link];
  End& own = each.ends[end];
  const End& other = each.ends[1 - end];
  own.begun = true;
  Hub& hub = hubs_[own.hub];
  hub.state->begin_connection(
      own.number, {hubs_[other.hub].state->self(), "link" + std::to_string(link), end == 0, 10},
      now_);
  if (hub.names) hub.names->begin_connection(own.number, now_);
  turn(own.hub);
}

void ScaleNet::end(std::size_t link) {
  links_[link].up = false;
  for (const End& each : links_[link].ends) {
    hubs_[each.hub].state->end_link(each.number);
    if (hubs_[each.hub].names) hubs_[each.hub].names->end_link(each.number);
    turn(each.hub);
  }
}

void ScaleNet::step() {
  now_ += milliseconds{1};
  while (!opens_.empty() && opens_.back().first <= now_) {
    open(opens_.back().second);
    opens_.pop_back();
  }
  arriving_.swap(sent_);
  for (const Message& message : arriving_) arrive(message);
  arriving_.clear();
  for (std::size_t link = 0; link < links_.size(); ++link)
    if ((now_.count() + static_cast<std::int64_t>(link)) % kKeepAliveMs == 0) keep_alive(link);
  for (std::size_t hub = 0; hub < hubs_.size(); ++hub)
    if (hubs_[hub].due && *hubs_[hub].due <= now_) turn(hub);
}

void ScaleNet::keep_alive(std::size_t link) {
  Link& each = links_[link];
  if (!each.up || !each.ends[1].begun) return;
  for (int end = 0; end < 2; ++end) {
    Hub& hub = hubs_[each.ends[end].hub];
    bytes_ += keep_alive_bytes();
    if (hub.whole && hubs_[each.ends[1 - end].hub].whole)
      sent_.push_back({link, 1 - end, nullptr, digest_of(hub)});
  }
}

std::uint64_t ScaleNet::digest_of(Hub& hub) {
  if (!hub.digest || hub.digest->first != now_) hub.digest = {now_, hub.state->digest()};
  return hub.digest->second;
}

void ScaleNet::arrive(const Message& message) {
  Link& link = links_[message.link];
  const End& end = link.ends[message.to];
  Hub& hub = hubs_[end.hub];
  if (!link.up) return;
  ++messages_;
  if (!end.begun) begin(message.link, message.to);
  if (message.bytes == nullptr) {
    hub.state->take_digest(end.number, message.digest, now_);
  } else {
    const auto view = proto::split_control(*message.bytes);
    const auto operation = static_cast<route::RouteOperation>(view->header.operation);
    if (operation == route::RouteOperation::records_end) {
      hub.state->take_mark(end.number);
    } else if (!hub.whole) {
      return;
    } else if (operation == route::RouteOperation::record) {
      hub.state->take_record(end.number, *message.bytes, now_);
    } else {
      hub.names->take(end.number, *message.bytes, now_);
      if (changes_names(*message.bytes)) changed_ = now_;
    }
  }
  hub.due = now_;
}

void ScaleNet::turn(std::size_t index) {
  Hub& each = hubs_[index];
  each.state->advance(now_);
  send(index, each.state->take_sendings());
  const bool new_map = each.state->maps() != each.maps;
  each.maps = each.state->maps();
  if (new_map && each.whole) changed_ = now_;
  each.due = each.state->next_due();
  if (each.names) {
    if (new_map) each.names->set_reachable(each.state->map(), each.state->store(), now_);
    each.names->advance(now_);
    send(index, each.names->take_sendings());
    static_cast<void>(each.names->take_changes());
    const auto due = each.names->next_due();
    if (due && (!each.due || *due < *each.due)) each.due = due;
  }
  if (each.due) each.due = std::max(*each.due, now_ + milliseconds{1});
}

void ScaleNet::send(std::size_t hub, std::span<const hub::Sending> sendings) {
  for (const hub::Sending& sending : sendings) {
    const auto [link, end] = ends_of_[hub][sending.link.value() - 1];
    bytes_ += proto::kHeaderSize + sending.bytes->size();
    sent_.push_back({link, 1 - end, sending.bytes});
  }
}

void ScaleNet::settle() {
  const milliseconds begun = now_;
  changed_ = now_;
  while (!opens_.empty() || now_ - changed_ < kQuiet) {
    GIMNET_CHECK(now_ - begun < kGiveUp);
    step();
  }
  require_equal();
}

void ScaleNet::require_equal() const {
  const std::uint64_t digest = hubs_.front().state->digest();
  for (const Hub& hub : hubs_) {
    if (!hub.whole) continue;
    GIMNET_CHECK(hub.state->map().ways().size() + 1 == hubs_.size());
    GIMNET_CHECK(hub.state->digest() == digest);
    GIMNET_CHECK(hub.names == nullptr || hub.names->copies().size() == shape_.names * hubs_.size());
  }
}

Figures ScaleNet::measure() {
  Figures figures;
  const std::uint64_t before = memory_now();
  for (std::size_t hub = 0; hub < hubs_.size(); ++hub) add_hub(hub);
  for (std::size_t link = 0; link < links_.size(); ++link)
    opens_.emplace_back(now_ + milliseconds{random_.below(kOpenWithinMs)}, link);
  std::ranges::sort(opens_, std::greater<>{});
  const milliseconds begun = now_;
  settle();
  figures.converged = changed_ - begun;
  figures.start_bytes = bytes_;
  sent_.shrink_to_fit();
  arriving_.shrink_to_fit();
  figures.memory_bytes = memory_now() - before;
  const std::uint64_t idle = bytes_;
  for (milliseconds until = now_ + kIdle; now_ < until;) step();
  figures.idle_bytes_per_s = bytes_ - idle;

  // The last link of a star is its last hub's only one: it is put back at the end.
  const std::size_t link = links_.size() - 1;
  const milliseconds ended = now_;
  const std::uint64_t until_then = bytes_;
  const bool is_star = shape_.whole != 0;
  if (is_star) {
    links_[link].up = false;
    hubs_[links_[link].ends[0].hub].state->end_link(links_[link].ends[0].number);
    turn(links_[link].ends[0].hub);
  } else {
    end(link);
  }
  changed_ = now_;
  while (now_ - changed_ < kQuiet) step();
  if (!is_star) require_equal();
  figures.rerouted = changed_ - ended;
  const auto passed = static_cast<std::uint64_t>((now_ - ended).count());
  figures.change_bytes = bytes_ - until_then;
  figures.change_bytes -= std::min(figures.change_bytes, figures.idle_bytes_per_s * passed / 1'000);
  figures.messages = messages_;
  figures.wholes = shape_.whole == 0 ? shape_.hubs : shape_.whole;
  return figures;
}

std::vector<Pair> mesh(std::size_t hubs, std::uint64_t seed) {
  Random random(seed);
  std::vector<Pair> links;
  for (std::size_t hub = 0; hub < hubs; ++hub) links.emplace_back(hub, (hub + 1) % hubs);
  for (std::size_t hub = 0; hub < hubs; ++hub) {
    const auto far = static_cast<std::size_t>(random.between(2, hubs - 2));
    links.emplace_back(hub, (hub + far) % hubs);
  }
  return links;
}

std::vector<Pair> star(std::size_t hubs) {
  std::vector<Pair> links;
  // A robot dials; it ends a link as the second one here does not.
  for (std::size_t hub = 1; hub < hubs; ++hub) links.emplace_back(0, hub);
  return links;
}

}  // namespace gimnet::sim::scale
