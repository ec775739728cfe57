#include "client/gimi/core.hpp"

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "base/clock.hpp"
#include "base/endian.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/loss_tally.hpp"
#include "client/gimi/message.hpp"
#include "proto/control/control_message.hpp"
#include "proto/frame/frame_header.hpp"
#include "proto/frame/window.hpp"

namespace gimnet::gimi {
namespace {

/// The bytes that the GIMI header and its extension may add to the application's.
constexpr std::size_t kHeaderRoom = 1024;

/// NIF refuses what its sender still waits with. Less than its window is on its way already: that
/// comes whole, so that this library can tell the sender of which message it speaks.
std::size_t nif_bytes_max(std::size_t message_bytes_max) {
  const std::size_t whole =
      std::max<std::size_t>(message_bytes_max, proto::kWindowDefault) + kHeaderRoom;
  return std::min<std::size_t>(whole, NIF_MESSAGE_BYTES_MAX);
}

/// Behind the words that the hub is back; "" if everything that was to be sent was taken.
std::string unsent_words(std::uint64_t messages) {
  if (messages == 0) return {};
  return "; " + std::to_string(messages) + (messages == 1 ? " message was" : " messages were") +
         " not sent meanwhile";
}

}  // namespace

Core::Core(const NodeOptions& options)
    : inbox_(
          options.queue_messages, options.receive_bytes, [this] { uplink_.deliver(); },
          [this](const TakenMessages& taken, bool more) { uplink_.credit(taken, more); },
          {[this] { attend(); }, [this] { services_.tell_missed(); }}),
      streams_(uplink_, [this](bool at_once) { clerk_.attend(at_once); }),
      services_(uplink_, inbox_,
                [this](const std::string& name, const ServicePlace& place) {
                  streams_.on_service_moved(name, place);
                  requests_.on_service_moved(name, place);
                }),
      watches_(uplink_),
      requests_(uplink_, [this] { clerk_.attend(true); }),
      answers_(uplink_, options.receive_bytes),
      accepted_(uplink_, inbox_),
      clerk_(uplink_, streams_, &requests_, &inbox_),
      reception_({uplink_, inbox_, streams_, services_, pings_, requests_, answers_, accepted_,
                  clerk_, losses_},
                 options.message_bytes_max) {}

Core::~Core() { close(); }

Outcome<std::shared_ptr<Core>> Core::join(const NodeOptions& options) {
  constexpr int kNumberMax = 99;
  const std::int64_t deadline = deadline_after(options.timeout);
  auto joined = join_as(options);
  NodeOptions numbered = options;
  for (int number = 2; options.number_if_taken && joined.is(Status::name_taken); ++number) {
    if (number > kNumberMax || is_over(deadline)) break;
    numbered.name = options.name + "-" + std::to_string(number);
    numbered.timeout = Timeout{nif_timeout_until(deadline)};
    joined = join_as(numbered);
  }
  return joined;
}

Outcome<std::shared_ptr<Core>> Core::join_as(const NodeOptions& options) {
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
  how.proxy = options.proxy.empty() ? nullptr : options.proxy.c_str();
  how.callback = &Core::on_incoming;
  how.user = this;
  how.credit_by_program = 1;
  nif_node* node = nullptr;
  const nif_status status = nif_connect(&how, &node);
  if (status != NIF_OK) return status;
  uplink_.open(node);
  tell(ConnectionChange::connected, "connected to the hub " + state_now().hub_name);
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
    // A caller that waits and leaves now may ask what became of the connection.
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
  requests_.end(ending);
  answers_.end(ending);
  accepted_.end(ending);
  connection_.end(ending);
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

Outcome<TracedPing> Core::ping(Peer to, Timeout timeout, Lane lane, BytesView echo, bool traced) {
  const std::int64_t deadline = deadline_after(timeout);
  std::vector<std::byte> data(proto::gimi::kPingTimeSize + echo.size());
  store_le(data.data(), wall_now_ns());
  std::ranges::copy(echo.span(), data.begin() + proto::gimi::kPingTimeSize);
  const std::uint32_t number = uplink_.next_ping();
  pings_.expect(number, to);
  Envelope envelope{to.id, NIF_UNICAST, NIF_POLICY_DEFAULT, lane, {}, 0, NIF_FLAG_REPORT};
  if (traced) envelope.trace_slots = kTraceHopsMax;
  const nif_status status = uplink_.transmit(
      envelope, {number, proto::gimi::MessageOperation::ping, 0, 0, pings_.epoch()}, false, data,
      nif_timeout(timeout));
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
      return reception_.on_message(in);
    case NIF_REPORT:
      reception_.on_report(in);
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
    case NIF_SUBSCRIBERS:
      return verdict_of(services_.on_subscribers(in.group, in.count));
    case NIF_SERVICE_MOVED:
      return verdict_of(services_.on_service_moved(in));
    case NIF_OWN_SERVICE_MOVED:
      return on_own_service_moved(in);
    case NIF_WATCHED:
      return watches_.on_watched(in) ? NIF_DONE : NIF_NOT_NOW;
    default:
      return NIF_DONE;
  }
}

nif_verdict Core::on_own_service_moved(const nif_incoming& in) {
  const ServiceTable::OwnMove move{in.former_group, in.group, ServiceTable::refusal_of(in)};
  ServiceTable::Place place = services_.on_own_service_moved(in.text, move);
  if (place == ServiceTable::Place::unknown) place = accepted_.on_own_service_moved(in.text, move);
  return verdict_of(place);
}

void Core::on_gap(const nif_incoming& in) {
  const auto reason = static_cast<proto::DropReason>(in.reason);
  if (reason == proto::DropReason::queue_full) return losses_.add_queue_full(in.from, in.count);
  if (reason == proto::DropReason::over_budget) return losses_.add_over_budget(in.count);
  if (reason == proto::DropReason::too_large) {
    losses_.add(reason, 1);
    return reception_.on_too_large(in);
  }
  // From itself: what this node sent. Its streams learn of the break by themselves.
  if (in.from == nif_id(node())) return;
  losses_.add(reason, in.count == NIF_COUNT_UNKNOWN ? 1 : in.count);
}

void Core::tell(ConnectionChange change, std::string why) {
  connection_.tell(change, uplink_.node_name(), std::move(why));
}

void Core::on_connected(const nif_incoming& in) {
  const bool resumed = (in.flags & NIF_CONNECTED_RESUMED) != 0;
  const std::string unsent = unsent_words(uplink_.take_unsent());
  if (resumed) {
    tell(ConnectionChange::resumed, "the hub is back, and the session goes on" + unsent);
  } else {
    tell(ConnectionChange::connected_anew,
         "the hub is back, and what was on its way is lost" + unsent);
  }
  reception_.on_reconnected();
  streams_.on_interrupted(0);
  services_.on_reconnected();
  if (resumed) return;
  streams_.on_broken({LossReason::connection_lost,
                      "the connection to the hub broke, and what was on its way is lost"});
  requests_.on_broken();
}

void Core::on_disconnected(const nif_incoming& in) {
  if (in.type == NIF_SESSION_REPLACED || (in.flags & NIF_DISCONNECTED_FOR_GOOD) != 0) {
    // NIF answers every call with the reason from now on; this one does nothing else.
    const nif_status status = nif_flush(node());
    const Ending ending(status_of(status), nif_error_text());
    tell(ConnectionChange::ended, "no connection will come any more: " + ending.why());
    streams_.on_broken({LossReason::connection_lost, ending.why()});
    end(ending);
    return;
  }
  tell(ConnectionChange::lost, std::string("lost the connection to the hub: ") + in.text);
  nif_info info{};
  info.struct_size = sizeof info;
  const bool kept = nif_get_info(node(), &info) == NIF_OK && info.resume != 0;
  if (kept) return streams_.on_interrupted(steady_now_ns());
  streams_.on_broken(
      {LossReason::connection_lost, std::string("the connection to the hub broke: ") + in.text});
}

}  // namespace gimnet::gimi
