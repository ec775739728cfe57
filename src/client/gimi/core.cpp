#include "client/gimi/core.hpp"

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "base/clock.hpp"
#include "base/endian.hpp"
#include "client/gimi/deadline.hpp"
#include "client/gimi/message_access.hpp"
#include "client/gimi/report_words.hpp"
#include "proto/control/control_message.hpp"
#include "proto/frame/frame_header.hpp"
#include "proto/frame/window.hpp"

namespace gimnet::gimi {
namespace {

/// What the GIMI header and its extension may add to the application's bytes.
constexpr std::size_t kHeaderRoom = 1024;
/// Status of an ERROR about a DATA that is larger than its receiver takes.
constexpr auto kTooLarge = static_cast<std::uint16_t>(proto::Status::limit);
/// Of what another node says, so many bytes are kept.
constexpr std::size_t kPeerWordsMax = 256;

/// NIF refuses what its sender still waits with. Less than its window is on its way already: that
/// comes whole, so that this library can tell the sender of which message it speaks.
std::size_t nif_bytes_max(std::size_t message_bytes_max) {
  const std::size_t whole =
      std::max<std::size_t>(message_bytes_max, proto::kWindowDefault) + kHeaderRoom;
  return std::min<std::size_t>(whole, NIF_MESSAGE_BYTES_MAX);
}

/// What another node says, fit for a terminal.
std::string plain_words(std::string_view sentence) {
  std::string words(sentence.substr(0, kPeerWordsMax));
  std::ranges::replace_if(words, [](char c) { return c < ' ' || c > '~'; }, '?');
  return words;
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

nif_verdict verdict_of(ServiceTable::Place place) {
  return place == ServiceTable::Place::not_yet ? NIF_NOT_NOW : NIF_DONE;
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

Core::Core(const NodeOptions& options)
    : message_bytes_max_(options.message_bytes_max),
      inbox_(
          options.queue_messages, options.receive_bytes,
          [this] { static_cast<void>(nif_deliver(node())); },
          [this](const TakenMessages& taken, bool more) {
            static_cast<void>(
                nif_credit(node(), taken.group, taken.epoch, taken.count, more ? 1 : 0));
          }),
      streams_(uplink_, [this](bool at_once) { clerk_.attend(at_once); }),
      services_(uplink_, inbox_,
                [this](const std::string& name, const ServicePlace& place) {
                  streams_.on_service_moved(name, place);
                }),
      watches_(uplink_),
      clerk_(uplink_, streams_) {}

Core::~Core() { close(); }

Outcome<std::shared_ptr<Core>> Core::join(const NodeOptions& options) {
  const std::shared_ptr<Core> core(new Core(options), [](Core* done) {
    // In a child after fork() its threads are missing, and its locks may be held: it stays.
    if (done->home().left()) return done->close();
    delete done;
  });
  const nif_status status = core->connect(options);
  if (status == NIF_OK) return core;
  core->closed_ = true;
  const char* words = nif_error_text();
  if (*words != '\0') return Failure{status_of(status), words};
  return failure_of(status,
                    "join " + (options.hub.empty() ? "the hub of this machine" : options.hub));
}

nif_status Core::connect(const NodeOptions& options) {
  nif_options how{};
  how.struct_size = sizeof how;
  how.url = options.hub.c_str();
  how.name = options.name.c_str();
  how.description = options.description.empty() ? nullptr : options.description.c_str();
  how.connect_timeout_ms = nif_timeout(options.timeout);
  how.wait_for_hub = options.wait_for_hub ? 1 : 0;
  how.no_reconnect = options.reconnect ? 0 : 1;
  how.no_token_file = options.keep_token ? 0 : 1;
  if (options.resume) how.resume = *options.resume ? NIF_RESUME_ON : NIF_RESUME_OFF;
  if (options.shard) how.shard_plus_one = static_cast<std::uint8_t>(*options.shard + 1);
  how.administrator = options.administrator ? 1 : 0;
  how.receive_queue_bytes = options.receive_bytes;
  how.message_bytes_max = nif_bytes_max(options.message_bytes_max);
  how.socket_receive_bytes = options.socket_receive_bytes;
  how.last_message_bytes = options.last_message_bytes;
  how.callback = &Core::on_incoming;
  how.user = this;
  how.credit_by_program = 1;
  nif_node* node = nullptr;
  const nif_status status = nif_connect(&how, &node);
  if (status != NIF_OK) return status;
  uplink_.open(node);
  clerk_.start();
  ready_ = true;
  static_cast<void>(nif_deliver(node));
  return NIF_OK;
}

void Core::close() {
  if (closed_.exchange(true)) return;
  if (home().left()) {
    static_cast<void>(nif_close(node()));
    return;
  }
  clerk_.stop();
  static_cast<void>(lost());  // NIF tells nothing of a handle that was closed
  {
    // Whoever waits and leaves now may ask what had become of the connection.
    NodeState state = state_now();
    const MutexLock lock(mutex_);
    closed_state_ = std::move(state);
  }
  end(Ending::closed());
  static_cast<void>(nif_close(node()));
}

/// Everybody who waits leaves, and who comes later does not wait.
void Core::end(const Ending& ending) {
  inbox_.end(ending);
  streams_.end(ending);
  services_.end(ending);
  watches_.end(ending);
  pings_.end(ending);
}

NodeState Core::state() const {
  {
    const MutexLock lock(mutex_);
    if (closed_state_) return *closed_state_;
  }
  return state_now();
}

LostCounts Core::lost() const {
  LostCounts counts = losses_.counts();
  nif_counters counters{};
  counters.struct_size = sizeof counters;
  // A number by itself.
  if (nif_get_counters(node(), &counters) == NIF_OK)
    unreadable_.store(counters.frames_unreadable, std::memory_order_relaxed);
  counts.unreadable += unreadable_.load(std::memory_order_relaxed);  // as above
  return counts;
}

NodeState Core::state_now() const {
  NodeState state;
  nif_info info{};
  info.struct_size = sizeof info;
  if (nif_get_info(node(), &info) != NIF_OK) return state;
  state.peer = Peer{info.id};
  state.name = info.name;
  state.hub_name = info.hub_name;
  state.hub_id = info.hub_id;
  state.connected = info.connected != 0;
  state.ended = info.ended != 0;
  state.reconnects = info.reconnects;
  if (info.keep_alive_seen != 0) {
    state.hub_round_trip_ns = info.round_trip_ns;
    state.hub_clock_offset_ns = info.clock_offset_ns;
  }
  nif_counters counters{};
  counters.struct_size = sizeof counters;
  if (nif_get_counters(node(), &counters) == NIF_OK)
    state.last_messages_not_kept = counters.last_messages_not_kept;
  state.trouble = uplink_.trouble();
  return state;
}

Outcome<std::int64_t> Core::ping(Peer to, Timeout timeout, Lane lane, BytesView echo) {
  const std::int64_t deadline = deadline_after(timeout);
  std::vector<std::byte> data(proto::gimi::kPingTimeSize + echo.size());
  store_le(data.data(), wall_now_ns());
  std::ranges::copy(echo.span(), data.begin() + proto::gimi::kPingTimeSize);
  const std::uint32_t number = uplink_.next_ping();
  pings_.expect(number, to);
  const Envelope envelope{to.id, NIF_UNICAST, NIF_POLICY_DEFAULT, lane, {}, 0, NIF_FLAG_REPORT};
  const nif_status status =
      uplink_.transmit(envelope, {number, proto::gimi::Operation::ping, 0, 0, ping_epoch_}, false,
                       data, nif_timeout(timeout));
  if (status == NIF_OK) return pings_.wait(number, deadline, timeout);
  pings_.forget(number);
  return failure_of(status, "ping " + to.text());
}

nif_verdict Core::on_incoming(void* user, const nif_incoming* in) {
  auto* core = static_cast<Core*>(user);
  // The first messages may come before connect() knows its handle.
  return core->ready_ ? core->dispatch(*in) : NIF_NOT_NOW;
}

nif_verdict Core::dispatch(const nif_incoming& in) {
  switch (in.type) {
    case NIF_MESSAGE:
      return on_message(in);
    case NIF_REPORT:
      on_report(in);
      return NIF_DONE;
    case NIF_GAP:
      on_gap(in);
      return NIF_DONE;
    case NIF_CONNECTED:
      on_connected(in);
      return NIF_DONE;
    case NIF_DISCONNECTED:
    case NIF_SESSION_REPLACED:
      on_disconnected(in);
      return NIF_DONE;
    case NIF_SUBSCRIBER_JOINED:
    case NIF_SUBSCRIBER_LEFT:
      return verdict_of(services_.on_subscribers(in.group, in.count));
    case NIF_SERVICE_MOVED:
      return verdict_of(services_.on_service_moved(in));
    case NIF_OWN_SERVICE_MOVED:
      return verdict_of(services_.on_own_service_moved(
          in.text, {in.former_group, in.group, ServiceTable::refusal_of(in)}));
    case NIF_NAME_LOST:
      on_renamed();
      return NIF_DONE;
    case NIF_WATCHED:
      return watches_.on_watched(in) ? NIF_DONE : NIF_NOT_NOW;
    default:
      return NIF_DONE;
  }
}

nif_verdict Core::on_message(const nif_incoming& in) {
  using proto::gimi::Operation;
  if ((in.flags & NIF_FLAG_KEYED) == 0) return on_plain(in);
  const auto view = proto::gimi::parse_message(payload_of(in));
  if (!view) {
    losses_.add_unreadable();
    return NIF_DONE;
  }
  switch (view->header.operation) {
    case Operation::data:
      return on_data(in, *view);
    case Operation::ack:
      on_ack(in, *view);
      return NIF_DONE;
    case Operation::error:
      on_error(in, *view);
      return NIF_DONE;
    case Operation::ping:
      on_ping(in, *view);
      return NIF_DONE;
    case Operation::pong:
      if (view->header.epoch == ping_epoch_) pings_.on_pong(view->header.sequence, Peer{in.from});
      return NIF_DONE;
    default:
      inbox_.count_dropped();
      return NIF_DONE;
  }
}

nif_verdict Core::on_data(const nif_incoming& in, const proto::gimi::MessageView& view) {
  if (view.data.size() > message_bytes_max_) return refuse(in, view);
  if (in.kind == NIF_GROUP) return on_group_data(in, view);
  const StreamName name = received_stream_of(in);
  StreamEpochs& epochs = received_.find({name.peer, in.kind, name.group, name.key});
  const StreamEpochs::Step step = epochs.look(view.header.epoch);
  if (step == StreamEpochs::Step::former) return drop_outdated();
  Message message = MessageAccess::make(in, view, nullptr, reconnects_);
  if (step == StreamEpochs::Step::begins) MessageAccess::begin_stream(message);
  AckReceipt receipt(clerk_, name, static_cast<Lane>(in.lane), view.header);
  const bool wanted = is_for_one(in) && view.header.has(proto::gimi::kFlagAckWanted);
  if (!inbox_.put(name.key, message, wanted ? &receipt : nullptr)) {
    MessageAccess::disown(message);
    return NIF_NOT_NOW;
  }
  epochs.take(view.header.epoch);
  return NIF_KEEP;
}

nif_verdict Core::on_plain(const nif_incoming& in) {
  const auto data = payload_of(in);
  if (data.size() > message_bytes_max_) {
    losses_.add(proto::DropReason::too_large, 1);
    return NIF_DONE;
  }
  MessageQueue* queue = nullptr;
  std::shared_ptr<const std::string> service_name;
  if (in.kind == NIF_GROUP) {
    const auto [place, service] = services_.subscribed(in.group != 0 ? in.group : in.to);
    if (place == ServiceTable::Place::unknown) losses_.add_unknown_service();
    if (service == nullptr) return verdict_of(place);
    queue = &service->queue();
    service_name = service->shared_name();
  }
  Message message = MessageAccess::make_plain(in, data, std::move(service_name), reconnects_);
  const bool taken = queue != nullptr ? inbox_.put(*queue, message, nullptr)
                                      : inbox_.put(MessageKey{}, message, nullptr);
  if (taken) return NIF_KEEP;
  MessageAccess::disown(message);
  return NIF_NOT_NOW;
}

nif_verdict Core::drop_outdated() {
  losses_.add_outdated();
  return NIF_DONE;
}

nif_verdict Core::on_group_data(const nif_incoming& in, const proto::gimi::MessageView& view) {
  const auto [place, service] = services_.subscribed(in.group != 0 ? in.group : in.to);
  if (place == ServiceTable::Place::unknown) losses_.add_unknown_service();
  if (service == nullptr) return verdict_of(place);
  // After a break the hub gives the last message of a retained service again: it does not know who
  // had it.
  const StreamName name = stream_of(in, in.from, 0);
  const SubscribedService::Position position{name.peer, name.key, view.header.epoch,
                                             view.header.sequence};
  if (service->is_repeated(position)) return NIF_DONE;
  const StreamEpochs::Step step = service->look(position);
  if (step == StreamEpochs::Step::former) return drop_outdated();
  Message message = MessageAccess::make(in, view, service->shared_name(), reconnects_);
  if (step == StreamEpochs::Step::begins) MessageAccess::begin_stream(message);
  if (!inbox_.put(service->queue(), message, nullptr)) {
    MessageAccess::disown(message);
    return NIF_NOT_NOW;
  }
  service->on_message(position);
  return NIF_KEEP;
}

nif_verdict Core::refuse(const nif_incoming& in, const proto::gimi::MessageView& view) {
  inbox_.count_dropped();
  losses_.add(proto::DropReason::too_large, 1);
  if (!is_for_one(in) || !view.header.has(proto::gimi::kFlagAckWanted)) return NIF_DONE;
  const std::string sentence = "it takes messages of at most " +
                               std::to_string(message_bytes_max_) + " bytes, and this one has " +
                               std::to_string(view.data.size());
  const StreamName name = received_stream_of(in);
  const Envelope envelope{
      in.from, NIF_UNICAST, NIF_POLICY_DEFAULT, static_cast<Lane>(in.lane), name.key, 0, 0};
  // Where there is no room for it, the sender learns from the next PONG that the message is not
  // here.
  static_cast<void>(uplink_.transmit(
      envelope, {view.header.sequence, proto::gimi::Operation::error, 0, 0, view.header.epoch},
      false, proto::gimi::encode_failure({kTooLarge, sentence, name.group}), 0));
  return NIF_DONE;
}

void Core::on_error(const nif_incoming& in, const proto::gimi::MessageView& view) {
  const auto failure = proto::gimi::decode_failure(view.data);
  if (!failure || failure->status != kTooLarge) return inbox_.count_dropped();
  streams_.on_refused(
      stream_of(in, in.from, failure->group), view.header,
      {LossReason::refused, "the receiver refused it: " + plain_words(failure->sentence)});
}

void Core::on_ack(const nif_incoming& in, const proto::gimi::MessageView& view) {
  const auto ack = proto::gimi::decode_ack(view.data);
  if (ack) streams_.on_ack(stream_of(in, in.from, ack->group), view.header, *ack);
}

void Core::on_ping(const nif_incoming& in, const proto::gimi::MessageView& view) {
  if (!is_for_one(in) || in.from == 0) return;
  const StreamName name = received_stream_of(in);
  const auto lane = static_cast<Lane>(in.lane);
  // Both fit or neither arrives: whoever misses them asks again.
  if (view.header.has(proto::gimi::kFlagAckWanted) &&
      clerk_.acknowledge(name, lane, view.header) != NIF_OK) {
    return;
  }
  const Envelope envelope{in.from, NIF_UNICAST, NIF_POLICY_DEFAULT, lane, name.key, 0, 0};
  static_cast<void>(uplink_.transmit(
      envelope, {view.header.sequence, proto::gimi::Operation::pong, 0, 0, view.header.epoch},
      false, view.data, 0));
}

void Core::on_report(const nif_incoming& in) {
  if (in.kind == static_cast<std::uint8_t>(proto::Kind::taken))
    return streams_.on_doubt(reported_loss(in.reason, in.text));
  if (!is_for_one(in)) return;
  const auto header = reported_header(in);
  const bool to_service = in.kind == NIF_SERVICE;
  const StreamName name = stream_of(in, to_service ? 0 : in.to, to_service ? in.to : 0);
  const bool keyed = (in.flags & NIF_FLAG_KEYED) != 0;
  StreamTable::Report report{name, keyed, in.reason, in.count, 0, 0, in.text};
  if (header && header->operation == proto::gimi::Operation::data) {
    report.sequence = header->sequence;
    report.epoch = header->epoch;
  }
  if (header && header->operation == proto::gimi::Operation::ping && header->epoch == ping_epoch_) {
    pings_.on_lost(header->sequence, report_words(report.text));
  }
  streams_.on_report(report);
}

void Core::on_gap(const nif_incoming& in) {
  // From itself: what this node sent. Its streams learn of the break by themselves.
  if (in.from == nif_id(node())) return;
  losses_.add(static_cast<proto::DropReason>(in.reason),
              in.count == NIF_COUNT_UNKNOWN ? 1 : in.count);
}

void Core::on_connected(const nif_incoming& in) {
  ++reconnects_;
  streams_.on_interrupted(0);
  services_.on_reconnected();
  if ((in.flags & NIF_CONNECTED_RESUMED) != 0) return;
  streams_.on_broken({LossReason::connection_lost,
                      "the connection to the hub broke, and what was on its way is lost"});
}

void Core::on_disconnected(const nif_incoming& in) {
  if (in.type == NIF_SESSION_REPLACED || (in.flags & NIF_DISCONNECTED_FOR_GOOD) != 0) {
    // NIF answers every call with the reason from now on; this one does nothing else.
    const nif_status status = nif_flush(node());
    const Ending ending(status_of(status), nif_error_text());
    streams_.on_broken({LossReason::connection_lost, ending.why()});
    end(ending);
    return;
  }
  nif_info info{};
  info.struct_size = sizeof info;
  const bool kept = nif_get_info(node(), &info) == NIF_OK && info.resume != 0;
  if (kept) return streams_.on_interrupted(steady_now_ns());
  streams_.on_broken(
      {LossReason::connection_lost, std::string("the connection to the hub broke: ") + in.text});
}

}  // namespace gimnet::gimi
