#include "hub/control/tellings.hpp"

#include <algorithm>
#include <map>
#include <utility>

#include "hub/control/state/records.hpp"
#include "hub/shard/control_frame.hpp"
#include "proto/control/ns_register.hpp"

namespace gimnet::hub {

namespace ns = proto::ns;

void Tellings::put(const ServiceChanged& moved) {
  const auto [entry, added] = waiting_.try_emplace(moved.full_name, false);
  entry->second |= moved.joins;
  if (added) order_.push_back(moved.full_name);
}

void Tellings::put(NodeIndex node, std::uint32_t attachment) {
  missed_.push_back({node, attachment});
}

void Tellings::work_off(std::uint64_t& most) {
  while (most > 0 && (round_ || !order_.empty())) {
    if (!round_) {
      const auto next = waiting_.extract(order_.front());
      round_ = Round{next.key(), next.mapped(), {}};
      order_.pop_front();
    }
    const Topic* topic = parts_.membership.topics().find(round_->full_name);
    if (topic == nullptr) {
      round_.reset();
      continue;
    }
    const std::span<const NodeIndex> all{topic->subscribers};
    const auto first = std::ranges::upper_bound(all, round_->last) - all.begin();
    const auto rest = all.subspan(static_cast<std::size_t>(first));
    const auto piece = rest.first(std::min<std::uint64_t>(rest.size(), most));
    tell(*topic, piece);
    if (round_->joins && topic->group(parts_.facts.id)) join(*topic, piece, true);
    most -= piece.size();
    if (piece.size() == rest.size()) {
      round_.reset();
    } else {
      round_->last = piece.back();
    }
  }
  while (most > 0 && !missed_.empty()) {
    most -= std::min<std::uint64_t>(most, tell_again(missed_.front()));
    missed_.pop_front();
  }
}

/// One frame for all that have the same window.
void Tellings::tell(const Topic& topic, std::span<const NodeIndex> subscribers) const {
  std::map<std::uint32_t, std::vector<std::vector<TellCommand::To>>> by_window;
  const auto send = [&](std::uint32_t window, std::size_t shard, std::vector<TellCommand::To>& to) {
    parts_.shards.send(ShardIndex{static_cast<std::uint8_t>(shard)},
                       TellCommand{std::exchange(to, {}), moved_frame(topic, NodeId{}, window)});
  };
  for (const NodeIndex subscriber : subscribers) {
    const Session* session = find(subscriber);
    // When it is back it is told with WELCOME.
    if (session == nullptr || !session->connected) continue;
    const std::uint32_t window = topic.window_of(subscriber);
    auto& by_shard = by_window[window];
    by_shard.resize(parts_.shards.shards());
    const std::size_t shard = session->place.shard.value();
    by_shard[shard].push_back(
        {ref_of(session->place), parts_.membership.sessions().node_id(*session)});
    if (by_shard[shard].size() == TellCommand::kToMost) send(window, shard, by_shard[shard]);
  }
  for (auto& [window, by_shard] : by_window) {
    for (std::size_t shard = 0; shard < by_shard.size(); ++shard) {
      if (!by_shard[shard].empty()) send(window, shard, by_shard[shard]);
    }
  }
}

/// In the table first: a subscriber that is paced asks for the last message at once.
void Tellings::join(const Topic& topic, std::span<const NodeIndex> subscribers,
                    bool with_event) const {
  parts_.publisher.publish_members(*topic.group(parts_.facts.id), subscribers, parts_.membership);
  for (const NodeIndex subscriber : subscribers) {
    if (const Session* session = find(subscriber)) begin_pace(topic, *session, with_event);
  }
}

/// Returns how many events those are, at least 1.
std::size_t Tellings::tell_again(const Missed& missed) const {
  const Session* session = find(missed.node);
  if (session == nullptr || !session->connected || session->attachment != missed.attachment)
    return 1;
  TellAgainCommand command{ref_of(session->place), session->attachment, {}};
  const Services& services = parts_.membership.services();
  add_moved(*session, session->change_seen, command.frames);
  const auto provided = services.provided_by(session->index);
  for (const Topic* topic : provided) {
    const auto frame =
        control_frame(proto::Kind::ns, parts_.membership.sessions().node_id(*session),
                      parts_.facts.id, subscribers_event(*topic));
    command.frames.insert(command.frames.end(), frame.begin(), frame.end());
  }
  parts_.shards.send(session->place.shard, std::move(command));
  join_moved(*session, session->change_seen);
  parts_.watches.start_over(session->index);
  return 1 + provided.size() + services.moved_since(session->index, session->change_seen).size();
}

void Tellings::add_moved(const Session& session, std::uint64_t change,
                         std::vector<std::byte>& frames) const {
  const NodeId to = parts_.membership.sessions().node_id(session);
  for (const Topic* topic : parts_.membership.services().moved_since(session.index, change)) {
    const auto frame = moved_frame(*topic, to, topic->window_of(session.index));
    frames.insert(frames.end(), frame.begin(), frame.end());
  }
}

void Tellings::join_moved(const Session& session, std::uint64_t change) const {
  for (const Topic* topic : parts_.membership.services().moved_since(session.index, change)) {
    if (topic->group(parts_.facts.id)) join(*topic, {&session.index, 1}, false);
  }
}

void Tellings::begin_pace(const Topic& topic, const Session& subscriber, bool with_event) const {
  const std::optional<SubscriberTerms> pace = topic.pace_of(subscriber.index);
  if (!pace) return;
  PaceCommand command;
  command.session = ref_of(subscriber.place);
  command.group = *topic.group(parts_.facts.id);
  command.terms = {pace->window, pace->depth, pace->interval_us};
  command.retained = topic.retains();
  command.was_plain = topic.once_plain.contains(subscriber.index);
  command.number = pace->number;
  command.with_event = with_event;
  parts_.shards.send(subscriber.place.shard, command);
}

proto::Payload Tellings::subscribers_event(const Topic& topic) const {
  return proto::encode(
      ns::Subscribers{make_id(parts_.facts.id, topic.service->group), topic.subscriber_count()});
}

std::vector<std::byte> Tellings::moved_frame(const Topic& topic, NodeId to,
                                             std::uint32_t window) const {
  ns::ServiceMoved event;
  event.name = std::string{topic.full_name};
  const NameCopies* names = parts_.names == nullptr ? nullptr : parts_.names->copies();
  put_state(event, HubTitle{parts_.facts.id, parts_.facts.name}, topic, parts_.membership, names);
  event.window = window;
  return control_frame(proto::Kind::ns, to, parts_.facts.id, proto::encode(event));
}

}  // namespace gimnet::hub
