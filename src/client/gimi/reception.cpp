#include "client/gimi/reception.hpp"

#include <algorithm>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "client/gimi/loss_tally.hpp"
#include "client/gimi/message.hpp"
#include "proto/control/control_message.hpp"
#include "proto/frame/extensions.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::gimi {
namespace {

/// Status of an ERROR about a DATA that is larger than its receiver takes.
constexpr auto kTooLarge = static_cast<std::uint16_t>(proto::Status::limit);
/// Of what another node says, so many bytes are kept.
constexpr std::size_t kPeerWordsMax = GIMI_SENTENCE_BYTES_MAX;

/// Another node's words, fit for a terminal.
std::string plain_words(std::string_view sentence) {
  std::string words(sentence.substr(0, kPeerWordsMax));
  std::ranges::replace_if(words, [](char c) { return c < ' ' || c > '~'; }, '?');
  return words;
}

std::span<const std::byte> extensions_of(const nif_incoming& in) {
  return {static_cast<const std::byte*>(in.extensions), in.extensions_size};
}

/// The hubs that a traced message passed.
std::vector<TraceHop> way_of(const nif_incoming& in) {
  std::vector<TraceHop> way;
  const auto trace = proto::find_trace(extensions_of(in));
  for (std::size_t i = 0; trace && i < trace->used(); ++i) {
    const proto::TraceSlot slot = trace->slot(i);
    way.push_back({slot.hub.value(), slot.arrival_ns, slot.departure_ns});
  }
  return way;
}

StreamName stream_of(const nif_incoming& in, std::uint32_t peer, std::uint32_t group) {
  const auto key = proto::gimi::StreamKey::of(in.key);
  return {Peer{peer}, {key.type, key.instance}, group};
}

/// As its receiver names it.
StreamName received_stream_of(const nif_incoming& in) {
  return stream_of(in, in.from, in.kind == NIF_SERVICE ? in.to : 0);
}

/// Somebody sent it to this node, or to a service of it.
bool is_for_one(const nif_incoming& in) { return in.kind == NIF_UNICAST || in.kind == NIF_SERVICE; }

std::span<const std::byte> payload_of(const nif_incoming& in) {
  return {static_cast<const std::byte*>(in.payload), in.size};
}

/// The ACK of a message becomes due before the program can take the message and leave.
class AckReceipt final : public Receipt {
 public:
  AckReceipt(Clerk& clerk, const StreamName& sender, Lane lane,
             const proto::gimi::MessageHeader& data)
      : clerk_(clerk), sender_(sender), lane_(lane), data_(data) {}
  void on_kept() override { clerk_.take(sender_, lane_, data_); }

 private:
  Clerk& clerk_;
  const StreamName& sender_;
  const Lane lane_;
  const proto::gimi::MessageHeader data_;
};

/// The GIMI header in the 20 bytes that a report repeats: behind the key, where nothing stands
/// before it. NIF takes the fragment header away of what it remembers.
std::optional<proto::gimi::MessageHeader> reported_header(const nif_incoming& in) {
  const auto bytes = payload_of(in);
  if (bytes.size() < proto::kHeaderSize + proto::kKeySize + proto::gimi::kMessageHeaderSize)
    return std::nullopt;
  const proto::FrameHeader header = proto::load_header(bytes.data());
  if (!header.has(proto::kFlagKeyed) || header.has(proto::kFlagFragment) ||
      header.has(proto::kFlagExt)) {
    return std::nullopt;
  }
  return proto::gimi::load_message_header(bytes.data() + proto::kHeaderSize + proto::kKeySize);
}

}  // namespace

nif_verdict Reception::on_message(const nif_incoming& in) {
  using proto::gimi::MessageOperation;
  if ((in.flags & NIF_FLAG_KEYED) == 0) return on_plain(in);
  const auto view = proto::gimi::parse_message(payload_of(in));
  if (!view) {
    losses_.add_unreadable();
    return NIF_DONE;
  }
  switch (view->header.operation) {
    case MessageOperation::data:
      return on_data(in, *view);
    case MessageOperation::request:
      return on_request(in, *view);
    case MessageOperation::reply:
      return on_reply(in, *view, view->data.size() > message_bytes_max_);
    case MessageOperation::ack:
      on_ack(in, *view);
      return NIF_DONE;
    case MessageOperation::error:
      on_error(in, *view);
      return NIF_DONE;
    case MessageOperation::ping:
      on_ping(in, *view);
      return NIF_DONE;
    case MessageOperation::pong:
      if (view->header.epoch == pings_.epoch())
        pings_.on_pong(view->header.sequence, Peer{in.from}, way_of(in));
      return NIF_DONE;
  }
  return NIF_DONE;
}

nif_verdict Reception::on_data(const nif_incoming& in, const proto::gimi::MessageView& view) {
  if (view.data.size() > message_bytes_max_) return refuse(in, view);
  if (in.kind == NIF_GROUP) return on_group_data(in, view);
  const StreamName name = received_stream_of(in);
  nif_verdict verdict = NIF_DONE;
  const auto service = accepting(in, verdict);
  if (!service) return verdict;
  StreamEpochs& epochs = received_.find({name.peer, in.kind, name.group, name.key});
  const StreamEpochs::Step step = epochs.look(view.header.epoch);
  if (step == StreamEpochs::Step::former) return drop_outdated();
  const OwnedServiceName service_name = *service ? (*service)->full_name() : nullptr;
  Message message = with_age(make_message(in, view, service_name.get(), reconnects_), in);
  if (step == StreamEpochs::Step::begins) message = begin_stream(std::move(message));
  AckReceipt receipt(clerk_, name, static_cast<Lane>(in.lane), view.header);
  const bool wanted = is_for_one(in) && view.header.has(proto::gimi::kFlagAckWanted);
  Receipt* const told = wanted ? &receipt : nullptr;
  const bool kept =
      *service ? inbox_.put((*service)->queue, message, told) : inbox_.put(name.key, message, told);
  if (!kept) {
    disown(std::move(message));
    return NIF_NOT_NOW;
  }
  epochs.take(view.header.epoch);
  return NIF_KEEP;
}

std::optional<AcceptedTable::Service> Reception::accepting(const nif_incoming& in,
                                                           nif_verdict& verdict) {
  if (in.kind != NIF_SERVICE) return nullptr;
  auto [place, service] = accepted_.find(in.to);
  if (place == ServiceTable::Place::unknown) losses_.add_unknown_service();
  verdict = verdict_of(place);
  if (service == nullptr) return std::nullopt;
  return std::move(service);
}

nif_verdict Reception::on_plain(const nif_incoming& in) {
  const auto data = payload_of(in);
  if (data.size() > message_bytes_max_) {
    losses_.add(proto::DropReason::too_large, 1);
    return NIF_DONE;
  }
  if (in.kind != NIF_GROUP) {
    nif_verdict verdict = NIF_DONE;
    const auto service = accepting(in, verdict);
    if (!service) return verdict;
    const OwnedServiceName name = *service ? (*service)->full_name() : nullptr;
    Message message = make_plain_message(in, data, name.get(), reconnects_);
    const bool kept = *service ? inbox_.put((*service)->queue, message, nullptr)
                               : inbox_.put(MessageKey{}, message, nullptr);
    if (kept) return NIF_KEEP;
    disown(std::move(message));
    return NIF_NOT_NOW;
  }
  const auto [place, service] = services_.subscribed(in.group != 0 ? in.group : in.to);
  if (place == ServiceTable::Place::unknown) losses_.add_unknown_service();
  if (service == nullptr) return verdict_of(place);
  return put(*service, {}, make_plain_message(in, data, &service->shared_name(), reconnects_));
}

nif_verdict Reception::put(SubscribedService& service,
                           const std::optional<SubscribedService::Position>& position,
                           Message message) {
  const SubscribedService::Put put = service.put(position, message);
  if (put == SubscribedService::Put::kept) return NIF_KEEP;
  disown(std::move(message));
  return put == SubscribedService::Put::no_room ? NIF_NOT_NOW : NIF_DONE;
}

Message Reception::with_age(Message message, const nif_incoming& in) const {
  if (in.extensions_size == 0) return message;
  const auto age = proto::find_age(extensions_of(in));
  const auto born = age ? uplink_.own_time(age->origin_ns) : std::nullopt;
  if (!born) return message;
  return born_at(std::move(message), born->steady_ns, born->error_ns);
}

nif_verdict Reception::drop_outdated() {
  losses_.add_outdated();
  return NIF_DONE;
}

nif_verdict Reception::on_group_data(const nif_incoming& in, const proto::gimi::MessageView& view) {
  const auto [place, service] = services_.subscribed(in.group != 0 ? in.group : in.to);
  if (place == ServiceTable::Place::unknown) losses_.add_unknown_service();
  if (service == nullptr) return verdict_of(place);
  const StreamName name = stream_of(in, in.from, 0);
  const SubscribedService::Position position{name.peer, name.key, view.header.epoch,
                                             view.header.sequence};
  const StreamEpochs::Step step = service->look(position);
  if (step == StreamEpochs::Step::former) return drop_outdated();
  Message message = with_age(make_message(in, view, &service->shared_name(), reconnects_), in);
  if (step == StreamEpochs::Step::begins) message = begin_stream(std::move(message));
  return put(*service, position, std::move(message));
}

nif_verdict Reception::refuse(const nif_incoming& in, const proto::gimi::MessageView& view) {
  inbox_.count_dropped();
  losses_.add(proto::DropReason::too_large, 1);
  if (in.kind == NIF_GROUP) miss(in, view.header);
  if (is_for_one(in) && view.header.has(proto::gimi::kFlagAckWanted))
    tell_too_large(in, view.header, "has " + std::to_string(view.data.size()));
  return NIF_DONE;
}

std::string Reception::limit_words() const {
  return "it takes messages of at most " + std::to_string(message_bytes_max_) + " bytes";
}

void Reception::tell_too_large(const nif_incoming& in, const proto::gimi::MessageHeader& data,
                               const std::string& size) {
  const std::string sentence = limit_words() + ", and this one " + size;
  const StreamName name = received_stream_of(in);
  const Envelope envelope{
      in.from, NIF_UNICAST, NIF_POLICY_DEFAULT, static_cast<Lane>(in.lane), name.key, 0, 0};
  // If there is no room for it, the sender learns from the next PONG that the message is missing.
  static_cast<void>(uplink_.transmit(
      envelope, {data.sequence, proto::gimi::MessageOperation::error, 0, 0, data.epoch}, false,
      proto::gimi::encode_error({kTooLarge, sentence, name.group}), 0));
}

void Reception::miss(const nif_incoming& in, const proto::gimi::MessageHeader& data) {
  const auto [place, service] = services_.subscribed(in.group != 0 ? in.group : in.to);
  const StreamName name = stream_of(in, in.from, 0);
  if (service != nullptr) service->miss({name.peer, name.key, data.epoch, data.sequence});
}

void Reception::on_too_large(const nif_incoming& in) {
  using proto::gimi::MessageOperation;
  const auto view = proto::gimi::parse_message(payload_of(in));
  if ((in.flags & NIF_FLAG_KEYED) == 0 || !view) return;
  const bool may_answer = is_for_one(in) && in.from != 0;
  switch (view->header.operation) {
    case MessageOperation::data:
      if (in.kind == NIF_GROUP) return miss(in, view->header);
      // NIF has told the sender of UNICAST by a TAKEN.
      if (in.kind == NIF_SERVICE && may_answer) tell_too_large(in, view->header, "is larger");
      return;
    case MessageOperation::request:
      if (may_answer) answer_fault(in, view->header, proto::gimi::RequestFault::too_large);
      return;
    case MessageOperation::reply: {
      nif_incoming beginning = in;
      beginning.storage = nullptr;  // NIF keeps that of an event
      static_cast<void>(on_reply(beginning, *view, true));
      return;
    }
    default:
      return;
  }
}

void Reception::answer_fault(const nif_incoming& in, const proto::gimi::MessageHeader& request,
                             proto::gimi::RequestFault fault) {
  const auto key = proto::gimi::StreamKey::of(in.key);
  const Envelope envelope{in.from,
                          NIF_UNICAST,
                          NIF_POLICY_DEFAULT,
                          static_cast<Lane>(in.lane),
                          {key.type, key.instance},
                          0,
                          0};
  const bool too_large = fault == proto::gimi::RequestFault::too_large;
  const std::string sentence = too_large ? limit_words() : "";
  static_cast<void>(uplink_.transmit(
      envelope, {request.sequence, proto::gimi::MessageOperation::error, 0, 0, request.epoch},
      false, proto::gimi::encode_request_error({fault, 0, sentence}), 0));
}

nif_verdict Reception::on_request(const nif_incoming& in, const proto::gimi::MessageView& view) {
  using proto::gimi::RequestFault;
  const auto body = proto::gimi::decode_request(view.data);
  if (!is_for_one(in) || in.from == 0 || !body) {
    losses_.add_unreadable();
    return NIF_DONE;
  }
  proto::gimi::MessageView request = view;
  request.data = body->data;
  Message message = make_message(in, request, nullptr, reconnects_);
  const auto queue = answers_.find(message.key());
  const bool too_large = request.data.size() > message_bytes_max_;
  if (queue != nullptr && !too_large) {
    if (queue->on_request(view.header, message, body->left_ms)) return NIF_KEEP;
  } else {
    answer_fault(in, view.header, too_large ? RequestFault::too_large : RequestFault::nobody);
  }
  disown(std::move(message));
  return NIF_DONE;
}

nif_verdict Reception::on_reply(const nif_incoming& in, const proto::gimi::MessageView& view,
                                bool too_large) {
  Message reply = make_message(in, view, nullptr, reconnects_);
  if (requests_.on_reply(view.header, reply, too_large)) return NIF_KEEP;
  disown(std::move(reply));
  return NIF_DONE;
}

void Reception::on_error(const nif_incoming& in, const proto::gimi::MessageView& view) {
  if (view.header.epoch == requests_.epoch()) {
    const auto error = proto::gimi::decode_request_error(view.data);
    if (!error) return losses_.add_unreadable();
    const std::string sentence = plain_words(error->sentence);
    const bool known =
        requests_.on_error(view.header, Peer{in.from}, {error->fault, error->code, sentence});
    if (known && error->fault == proto::gimi::RequestFault::too_large) uplink_.give_up(view.header);
    return;
  }
  const auto failure = proto::gimi::decode_error(view.data);
  if (!failure || failure->status != kTooLarge) return inbox_.count_dropped();
  const bool known = streams_.on_refused(
      stream_of(in, in.from, failure->group), view.header,
      {LossReason::refused, "the receiver refused it: " + plain_words(failure->sentence)});
  if (known) uplink_.give_up(view.header);
}

void Reception::on_ack(const nif_incoming& in, const proto::gimi::MessageView& view) {
  const auto ack = proto::gimi::decode_ack(view.data);
  if (ack) streams_.on_ack(stream_of(in, in.from, ack->group), view.header, *ack);
}

void Reception::on_ping(const nif_incoming& in, const proto::gimi::MessageView& view) {
  if (!is_for_one(in) || in.from == 0) return;
  const StreamName name = received_stream_of(in);
  const auto lane = static_cast<Lane>(in.lane);
  // Both fit or neither arrives: whoever misses them asks again.
  if (view.header.has(proto::gimi::kFlagAckWanted) &&
      clerk_.acknowledge(name, lane, view.header) != NIF_OK) {
    return;
  }
  Envelope envelope{in.from, NIF_UNICAST, NIF_POLICY_DEFAULT, lane, name.key, 0, 0};
  if (proto::find_trace(extensions_of(in))) envelope.trace_slots = kTraceHopsMax;
  static_cast<void>(uplink_.transmit(
      envelope,
      {view.header.sequence, proto::gimi::MessageOperation::pong, 0, 0, view.header.epoch}, false,
      view.data, 0));
}

void Reception::on_report(const nif_incoming& in) {
  if (in.kind == static_cast<std::uint8_t>(proto::Kind::taken))
    return streams_.on_doubt(reported_loss(in.reason, in.text));
  const auto header = reported_header(in);
  if (in.reason == NIF_DROP_NOT_RETAINED) return services_.on_not_retained(in.to, header);
  if (!is_for_one(in)) return;
  if (header && header->operation == proto::gimi::MessageOperation::request) {
    if (header->epoch == requests_.epoch())
      requests_.on_report(header->sequence, in.reason, report_words(in.text));
    return;
  }
  const bool to_service = in.kind == NIF_SERVICE;
  const StreamName name = stream_of(in, to_service ? 0 : in.to, to_service ? in.to : 0);
  const bool keyed = (in.flags & NIF_FLAG_KEYED) != 0;
  StreamTable::Report report{name, keyed, in.reason, in.count, 0, 0, in.text};
  if (header && header->operation == proto::gimi::MessageOperation::data) {
    report.sequence = header->sequence;
    report.epoch = header->epoch;
  }
  if (header && header->operation == proto::gimi::MessageOperation::ping &&
      header->epoch == pings_.epoch()) {
    pings_.on_lost(header->sequence, {dropped_status(in.reason), report_words(report.text)});
  }
  streams_.on_report(report);
}

}  // namespace gimnet::gimi
