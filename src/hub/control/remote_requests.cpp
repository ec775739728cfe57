#include "hub/control/remote_requests.hpp"

#include <string>

#include "hub/shard/control_frame.hpp"

namespace gimnet::hub {
namespace {

using std::chrono::milliseconds;

std::span<const std::byte> payload_of(const ControlFrameEvent& event) {
  return std::span{event.frame}.subspan(proto::kHeaderSize);
}

/// False: the frame crossed as many links as it may.
bool count_hop(std::vector<std::byte>& frame) {
  auto& hops = frame[proto::kHopsOffset];
  if (std::to_integer<std::uint8_t>(hops) >= proto::kHopsMax) return false;
  hops = static_cast<std::byte>(std::to_integer<std::uint8_t>(hops) + 1);
  return true;
}

}  // namespace

std::optional<proto::Refusal> RemoteRequests::send_on(const ControlFrameEvent& event,
                                                      ShardIndex shard, milliseconds now) {
  const proto::FrameHeader header = proto::load_header(event.frame.data());
  const HubId hub = hub_of(NodeId{header.dst});
  const auto control = proto::split_control(payload_of(event));
  const bool to_a_hub = index_of(NodeId{header.dst}) == kHubIndex;
  if (parts_.links.next_hops().find(hub).one_way) {
    return proto::Refusal{proto::Status::denied,
                          "the link towards hub " + std::to_string(hub.value()) +
                              " may not bring its answers: see `allow` in docs/operations.md"};
  }
  if (!control || !to_a_hub || !parts_.links.next_hops().send_towards(hub, event.frame)) {
    return proto::Refusal{proto::Status::not_found,
                          "there is no route from hub " + std::to_string(parts_.facts.id.value()) +
                              " to hub " + std::to_string(hub.value()) + "; see gimnet hubs"};
  }
  const Key key{event.node, hub, control->header.request};
  asked_[key] = {event.session, shard,           event.attachment,
                 header.kind,   control->header, now + kAnswerTime};
  due_.emplace_back(now + kAnswerTime, key);
  return std::nullopt;
}

bool RemoteRequests::take(const ControlFrameEvent& event, milliseconds now) {
  const proto::FrameHeader header = proto::load_header(event.frame.data());
  const HubId from = hub_of(event.node);
  const NodeId dst{header.dst};
  if (hub_of(dst) != parts_.facts.id) {
    std::vector<std::byte> frame = event.frame;
    if (count_hop(frame))
      static_cast<void>(parts_.links.next_hops().send_towards(hub_of(dst), std::move(frame), from));
    return false;
  }
  const auto control = proto::split_control(payload_of(event));
  if (!control) return false;
  if (control->header.is_answer()) {
    // Only hubs answer: a node could say for its hub that a name is let go.
    if (index_of(NodeId{header.src}) != kHubIndex) return false;
    const HubId answers = hub_of(NodeId{header.src});
    if (index_of(dst) == kHubIndex) {
      own_answers_.push_back(
          {answers, control->header.request, proto::read_status(control->body).status});
    } else {
      settle({dst, answers, control->header.request}, event.frame);
    }
    return false;
  }
  if (rates_[event.node].take(kRate, now)) return true;
  answer(event, proto::encode_refusal(
                    control->header,
                    {proto::Status::rate, "too many requests come over one link; ask again"}));
  return false;
}

void RemoteRequests::answer(const ControlFrameEvent& event, const proto::Payload& payload) {
  const proto::FrameHeader header = proto::load_header(event.frame.data());
  const NodeId asker{header.src};
  // The way back may lead over the neighbour that it came from.
  static_cast<void>(parts_.links.next_hops().send_towards(
      hub_of(asker), control_frame(header.kind, asker, parts_.facts.id, payload)));
}

void RemoteRequests::settle(const Key& key, std::vector<std::byte> frame) {
  const auto found = asked_.find(key);
  if (found == asked_.end()) return;
  SendControlCommand command;
  command.session = found->second.session;
  command.attachment = found->second.attachment;
  command.frame = std::move(frame);
  command.answers = 1;
  parts_.shards.send(found->second.shard, std::move(command));
  asked_.erase(found);
}

void RemoteRequests::tick(milliseconds now) {
  for (; !due_.empty() && due_.front().first <= now; due_.pop_front()) {
    const Key key = due_.front().second;
    const auto found = asked_.find(key);
    if (found == asked_.end() || found->second.until != due_.front().first) continue;
    const std::string hub = std::to_string(key.hub.value());
    const proto::Payload payload = proto::encode_refusal(
        found->second.header, {proto::Status::not_found, "hub " + hub + " did not answer within " +
                                                             std::to_string(kAnswerTime.count()) +
                                                             " ms; see gimnet hubs"});
    settle(key, control_frame(found->second.kind, key.node, parts_.facts.id, payload));
  }
}

std::optional<milliseconds> RemoteRequests::next_due() const {
  return due_.empty() ? std::nullopt : std::optional{due_.front().first};
}

}  // namespace gimnet::hub
