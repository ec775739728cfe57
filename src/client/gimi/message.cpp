#include "client/gimi/message.hpp"

#include <utility>

#include "base/id_text.hpp"

namespace gimnet {

std::string Peer::text() const { return to_string(NodeId{id}); }

std::optional<Peer> Peer::parse(std::string_view text) {
  const auto node = parse_node_id(text);
  if (!node) return std::nullopt;
  return Peer{node->value()};
}

Message::~Message() {
  if (storage_ == nullptr) return;
  nif_incoming in{};
  in.storage = storage_;
  nif_release(&in);
}

void Message::swap(Message& other) noexcept {
  std::swap(data_, other.data_);
  std::swap(storage_, other.storage_);
  std::swap(service_, other.service_);
  std::swap(sent_ns_, other.sent_ns_);
  std::swap(arrival_ns_, other.arrival_ns_);
  std::swap(from_, other.from_);
  std::swap(key_, other.key_);
  std::swap(sequence_, other.sequence_);
  std::swap(reconnects_, other.reconnects_);
  std::swap(lane_, other.lane_);
  std::swap(begins_stream_, other.begins_stream_);
  std::swap(plain_, other.plain_);
  std::swap(latest_, other.latest_);
  std::swap(group_, other.group_);
  std::swap(epoch_, other.epoch_);
}

Message MessageAccess::make(const nif_incoming& in, const proto::gimi::MessageView& view,
                            std::shared_ptr<const std::string> service, std::uint32_t reconnects) {
  const auto key = proto::gimi::StreamKey::of(in.key);
  Message message;
  message.data_ = view.data;
  message.storage_ = in.storage;
  message.service_ = std::move(service);
  message.sent_ns_ = view.timestamp_ns;
  message.arrival_ns_ = in.arrival_ns;
  message.from_ = Peer{in.from};
  message.key_ = {key.type, key.instance};
  message.sequence_ = view.header.sequence;
  message.reconnects_ = reconnects;
  message.lane_ = static_cast<Lane>(in.lane);
  message.latest_ = in.policy == NIF_LATEST;
  message.group_ = in.to;
  message.epoch_ = in.epoch;
  return message;
}

Message MessageAccess::make_plain(const nif_incoming& in, std::span<const std::byte> data,
                                  std::shared_ptr<const std::string> service,
                                  std::uint32_t reconnects) {
  proto::gimi::MessageView view;
  view.data = data;
  Message message = make(in, view, std::move(service), reconnects);
  message.key_ = {};
  message.plain_ = true;
  return message;
}

}  // namespace gimnet
