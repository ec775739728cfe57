#include "client/gimi/uplink.hpp"

#include <array>
#include <cstddef>
#include <span>
#include <utility>

#include "base/clock.hpp"
#include "base/endian.hpp"
#include "base/random.hpp"
#include "client/nif/api.hpp"
#include "gimnet/gimi_options.h"
#include "proto/gimi/request.hpp"

namespace gimnet::gimi {

Status status_of(nif_status status) {
  switch (status) {
    case NIF_TIMEOUT:
      return Status::timeout;
    case NIF_BAD_ARGUMENT:
    case NIF_BAD_REQUEST:
    case NIF_IN_CALLBACK:
    case NIF_BUFFER_TOO_SMALL:
      return Status::bad_argument;
    case NIF_NO_HUB:
      return Status::no_hub;
    case NIF_NO_HOST:
      return Status::no_host;
    case NIF_NOT_CONNECTED:
      return Status::not_connected;
    case NIF_BAD_VERSION:
      return Status::bad_version;
    case NIF_NAME_TAKEN:
      return Status::name_taken;
    case NIF_BAD_NAME:
      return Status::bad_name;
    case NIF_HUB_FULL:
    case NIF_REFUSED:
    case NIF_REPLACED:
    case NIF_NOT_SUPPORTED:
      return Status::refused;
    case NIF_NOT_FOUND:
      return Status::not_found;
    case NIF_TAKEN:
      return Status::taken;
    case NIF_DENIED:
      return Status::denied;
    case NIF_LIMIT:
      return Status::limit;
    case NIF_TOO_LARGE:
      return Status::too_large;
    case NIF_NOT_DELIVERED:
      return Status::not_delivered;
    case NIF_PROTOCOL:
      return Status::protocol;
    case NIF_NO_MEMORY:
    case NIF_SYSTEM:
      return Status::system;
    case NIF_FORKED:
      return Status::forked;
    case NIF_NOT_RETAINED:
      return Status::not_retained;
    case NIF_OK:
    case NIF_CLOSED:
      break;
  }
  return Status::closed;
}

Failure failure_of(nif_status status, std::string_view doing) {
  const std::string_view words = nif_error_text();
  // NIF's sentences mostly begin so themselves, and name more.
  if (words.starts_with("cannot ")) return {status_of(status), std::string(words)};
  std::string sentence = "cannot " + std::string(doing) + ": ";
  sentence += words.empty() ? std::string_view(nif_status_text(status)) : words;
  return {status_of(status), std::move(sentence)};
}

namespace {

/// By which NIF finds a message that is being sent. Epochs are drawn for each stream.
std::uint64_t tag_of(const proto::gimi::MessageHeader& header) {
  return (std::uint64_t{header.epoch} << 32) | header.sequence;
}

}  // namespace

nif_status Uplink::transmit(const Envelope& envelope, proto::gimi::MessageHeader header,
                            bool stamped, BytesView data, std::int32_t timeout_ms) const {
  if (data.size() > GIMI_MESSAGE_BYTES_MAX)
    return nif::fail(NIF_TOO_LARGE, "cannot send: the message is larger than 1 GiB");
  std::array<std::byte, proto::gimi::kMessagePrefixMax + proto::gimi::kRequestPrefix> prefix;
  const auto stamp = stamped ? std::optional(wall_now_ns()) : std::nullopt;
  std::size_t prefix_size = proto::gimi::write_message_prefix(
      header, stamp, std::span(prefix).first<proto::gimi::kMessagePrefixMax>());
  if (header.operation == proto::gimi::MessageOperation::request) {
    store_le(prefix.data() + prefix_size, envelope.left_ms);
    prefix_size += proto::gimi::kRequestPrefix;
  }
  const std::array<nif_bytes, 2> parts{nif_bytes{prefix.data(), prefix_size},
                                       nif_bytes{data.data(), data.size()}};
  nif_outgoing outgoing = NIF_OUTGOING_INIT;
  outgoing.kind = static_cast<std::uint8_t>(envelope.kind);
  outgoing.lane = static_cast<std::uint8_t>(envelope.lane);
  outgoing.policy = static_cast<std::uint8_t>(envelope.policy);
  outgoing.flags = static_cast<std::uint8_t>(envelope.flags | NIF_FLAG_KEYED);
  outgoing.to = envelope.to;
  outgoing.key = proto::gimi::StreamKey{envelope.key.type, envelope.key.instance}.value();
  outgoing.parts = parts.data();
  outgoing.part_count = parts.size();
  outgoing.age_ms_max = envelope.age_ms_max;
  outgoing.trace_slots = envelope.trace_slots;
  nif::Node* const direct = direct_.load();
  if (direct == nullptr) return NIF_CLOSED;
  return nif::guarded([&] { return direct->send(outgoing, timeout_ms, tag_of(header)); });
}

void Uplink::open(nif_node* node) {
  direct_.store(nif::share_node(node));
  node_.store(node);
}

Uplink::~Uplink() {
  if (nif::Node* const direct = direct_.load()) direct->drop();
}

void Uplink::give_up(const proto::gimi::MessageHeader& header) const {
  if (nif::Node* const direct = direct_.load()) direct->outbound().give_up(tag_of(header));
}

void Uplink::credit(const TakenMessages& taken, bool more) const {
  nif::Node* const direct = direct_.load();
  if (direct == nullptr || taken.epoch == 0) return;
  static_cast<void>(nif::guarded([&]() -> nif_status {
    direct->credits().take(taken.group, taken.epoch, taken.count, more);
    return NIF_OK;
  }));
}

void Uplink::deliver() const {
  if (nif::Node* const direct = direct_.load()) direct->thread().deliver_again();
}

void Uplink::set_task(std::function<net::Deadline()> task) const {
  if (nif::Node* const direct = direct_.load()) direct->thread().set_task(std::move(task));
}

void Uplink::rouse() const {
  if (nif::Node* const direct = direct_.load()) direct->thread().rouse();
}

bool Uplink::is_away(const std::string& full_name) const {
  nif::Node* const direct = direct_.load();
  return direct != nullptr && direct->declarations().is_away(full_name);
}

bool Uplink::tell_missed(std::uint32_t group, std::uint64_t total) const {
  nif::Node* const direct = direct_.load();
  bool told = false;
  if (direct == nullptr) return told;
  static_cast<void>(nif::guarded([&]() -> nif_status {
    told = direct->credits().tell_missed(GroupId{group}, total);
    return NIF_OK;
  }));
  return told;
}

std::optional<nif::HubClock::OwnTime> Uplink::own_time(std::int64_t hub_ns) const {
  nif::Node* const direct = direct_.load();
  return direct == nullptr ? std::nullopt : direct->clock().own_time(hub_ns);
}

std::string Uplink::node_name() const {
  nif_info info{};
  info.struct_size = sizeof info;
  static_cast<void>(nif_get_info(node(), &info));
  return *info.name != '\0' ? info.name : Peer{info.id}.text();
}

void Uplink::note_unsent(nif_status why, AtTimeout at_timeout) const {
  nif::Node* const direct = direct_.load();
  if (direct == nullptr) return;
  const bool away =
      why == NIF_NOT_CONNECTED ||
      (why == NIF_TIMEOUT && at_timeout == AtTimeout::give_up && direct->info().connected == 0);
  if (away) unsent_.fetch_add(1, std::memory_order_relaxed);  // a number by itself
}

std::uint64_t Uplink::take_unsent() const {
  return unsent_.exchange(0, std::memory_order_relaxed);  // a number by itself
}

std::string Uplink::trouble() const {
  std::string words(NIF_SENTENCE_BYTES_MAX, '\0');
  // It may be another, longer one by now.
  for (std::size_t size = 0;
       (size = nif_last_error(node(), words.data(), words.size())) >= words.size();) {
    words.assign(size + 1, '\0');
  }
  words.resize(words.find('\0'));
  return words;
}

std::uint32_t Uplink::next_ping() {
  std::uint32_t number = 0;
  while (number == 0) number = ++pings_;
  return number;
}

std::uint32_t Uplink::draw_epoch() { return static_cast<std::uint32_t>(random_bits()); }

}  // namespace gimnet::gimi
