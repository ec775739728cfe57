#include <algorithm>
#include <array>
#include <new>
#include <string>
#include <utility>

#include "client/nif/outbound.hpp"
#include "proto/frame/fragmenter.hpp"

// The calls that wait: sending, flushing, draining.

namespace gimnet::nif {
namespace {

/// Of a PING that asks for a CONFIRM; HubClock, which counts from 1, takes its PONG for nothing
/// that it asked.
constexpr std::uint32_t kAskSequence = 0;
/// The receiver of a message may leave its window closed this long before it is asked whether it
/// is still there.
constexpr std::int64_t kProbeNs = 1'000'000'000;

}  // namespace

bool Outbound::may_go(const Outgoing& message, std::size_t frame_size, const SendProgress* own) {
  if (!usable()) return false;
  if (own != nullptr ? own->stalled() : !under_way_.may_begin(message)) return false;
  return gate_.lets_in(message, frame_size);
}

/// Waits until a frame of the message may enter the queue. `own`: the message is under way already.
nif_status Outbound::wait_for_turn(Outgoing& message, std::size_t frame_size,
                                   const SendProgress* own, Deadline deadline) {
  if (own != nullptr) return wait_until_it_may_go(message, frame_size, own, deadline);
  moves_.redirect(message);
  const nif_status status = wait_until_it_may_go(message, frame_size, own, deadline);
  moves_.redirect(message);  // its service may have another group since it waits
  return status;
}

nif_status Outbound::wait_until_it_may_go(const Outgoing& message, std::size_t frame_size,
                                          const SendProgress* own, Deadline deadline) {
  std::int64_t probe_at = 0;
  for (;;) {
    const bool waits = queue_.resume() && (own != nullptr || !message.not_while_away());
    if (connection_.ended() || (connection_.away() && !waits)) return connection_.not_connected();
    if (own != nullptr) {
      if (const nif_status status = under_way_.check(*own); status != NIF_OK) return status;
    }
    const bool settled = connection_.connected() && moves_.settled();
    if (settled && gate_.refuses(message)) {
      return fail(NIF_REFUSED,
                  "the hub did not take the service again, after a break or another name");
    }
    if (may_go(message, frame_size, own)) return NIF_OK;
    // Messages that NIF_FLAG_MORE held back, or that were left to the library's thread, go before
    // anybody waits for room.
    if (writer_.write_here(mutex_)) continue;
    const std::int64_t now = steady_now_ns();
    if (now >= deadline) return connection_.no_turn();
    const bool stalled = own != nullptr && own->stalled() && connection_.connected();
    if (stalled && probe_at == 0) probe_at = now + kProbeNs;
    if (stalled && now >= probe_at) {
      frames_.append_probe(own->dst);
      write_or_leave(false);
      probe_at = now + kProbeNs;
    }
    static_cast<void>(waiters_.wait(mutex_, stalled ? std::min(deadline, probe_at) : deadline));
  }
}

/// For a message that has a fragment header.
std::uint32_t Outbound::number_of(Outgoing& message, bool windowed) {
  const std::uint32_t number = frames_.next_number();
  if (message.reported() || windowed || is_retained(message)) reported_.remember(number, message);
  return number;
}

nif_status Outbound::send_whole(Outgoing& message, Deadline deadline) {
  const bool with_header = proto::needs_fragment_header(message.size());
  const std::size_t frame = FrameAppender::frame_size(message, with_header, message.size());
  const nif_status turn = wait_for_turn(message, frame, nullptr, deadline);
  if (turn != NIF_OK) return turn;
  std::optional<std::uint32_t> number;
  if (with_header) number = number_of(message, false);
  frames_.append_whole(message, number);
  return NIF_OK;
}

nif_status Outbound::send_pieces(Outgoing& message, SendProgress& progress, Deadline deadline) {
  const std::uint32_t largest = frames_.piece_max(message);
  const std::size_t frame = FrameAppender::frame_size(message, true, largest);
  proto::Fragmenter fragmenter(message.size(), largest);
  while (!fragmenter.done()) {
    const nif_status turn = wait_for_turn(message, frame, &progress, deadline);
    if (turn == NIF_TIMEOUT && progress.number != 0) {
      under_way_.hold(message, progress, fragmenter);
      return NIF_OK;
    }
    if (turn != NIF_OK) return turn;
    if (progress.number == 0)
      under_way_.begin(message, progress, number_of(message, progress.windowed));
    frames_.append_piece(message, progress, fragmenter);
    write_or_leave(!fragmenter.done() || message.more());
  }
  return NIF_OK;
}

nif_status Outbound::send_fragments(Outgoing& message, Deadline deadline) {
  const std::size_t frame = FrameAppender::frame_size(message, true, proto::kFragmentPayload);
  const nif_status turn = wait_for_turn(message, frame, nullptr, deadline);
  if (turn != NIF_OK) return turn;
  SendProgress progress{.number = 0,
                        .dst = message.parts().header.dst,
                        .windowed = message.parts().header.kind == proto::Kind::unicast &&
                                    message.size() > proto::kWindowDefault,
                        .window = proto::SendWindow(0, message.size())};
  under_way_.add(message, progress);
  nif_status status = NIF_NO_MEMORY;
  try {
    status = send_pieces(message, progress, deadline);
  } catch (const std::bad_alloc&) {
    writer_.give_up();
    status =
        fail(NIF_NO_MEMORY, "no memory for the message; if it had begun, its receiver lost it");
  }
  under_way_.end(message, progress);
  waiters_.notify();
  return status;
}

nif_status Outbound::send(Outgoing& message, Deadline deadline) {
  const Inside inside(*this);
  const bool whole = message.size() <= proto::kUncutMessageMax;
  reports_wanted_ |= message.reported();
  message.set_patient(deadline == kNever);
  const nif_status status =
      whole ? send_whole(message, deadline) : send_fragments(message, deadline);
  if (status != NIF_OK) return status;
  ++messages_sent_;
  const bool retained = is_retained(message);
  if (retained) last_.keep(message);
  if (whole) write_or_leave(message.more());
  return retained ? check_retained(message) : NIF_OK;
}

bool Outbound::is_retained(const Outgoing& message) const {
  return message.is_group() && last_.follows(message.parts().header.dst);
}

/// The message went; does the hub keep it, as far as its WELCOME tells?
nif_status Outbound::check_retained(Outgoing& message) const {
  const std::uint32_t data = message.application_bytes();
  if (!hub_retains_ || data <= *hub_retains_) return NIF_OK;
  return fail(NIF_NOT_RETAINED,
              "the hub does not keep the message of " + std::to_string(data) +
                  " bytes for those who subscribe later, only of " + std::to_string(*hub_retains_) +
                  " bytes and less; send less, or raise its limits retained_message_bytes and "
                  "retained_budget_bytes");
}

nif_status Outbound::flush() {
  const MutexLock lock(mutex_);
  if (!connection_.connected()) return connection_.not_connected();
  static_cast<void>(writer_.write_here(mutex_));
  return NIF_OK;
}

/// The hub says by itself only now and then what it took, but always when it is asked by a PING.
/// True: it was asked. One question at a time: the answer to an earlier one may be all that is
/// wanted, and if not the next one follows it.
bool Outbound::ask_for_confirm() {
  if (asked_ || !writer_.ready() || !queue_.all_written()) return false;
  frames_.append_flow(proto::flow::Ping{kAskSequence, wall_now_ns()});
  asked_ = true;
  write_or_leave(false);
  return true;
}

nif_status Outbound::drain(Deadline deadline) {
  const Inside inside(*this);
  for (;;) {
    if (connection_.ended()) return connection_.not_connected();
    if (connection_.away() && !queue_.resume()) return connection_.not_connected();
    // An empty queue proves nothing once something was thrown out of it.
    if (std::exchange(lost_, false)) {
      return fail(NIF_NOT_CONNECTED,
                  "the connection was lost before everything was confirmed; some of it may not "
                  "have arrived");
    }
    const bool nothing_waits = writer_.all_sent() && !under_way_.holds_any() && !writer_.writing();
    if (nothing_waits && queue_.retained_bytes() == 0) return NIF_OK;
    if (writer_.write_here(mutex_) || ask_for_confirm()) continue;
    if (deadline != kNever && steady_now_ns() >= deadline) {
      return fail(NIF_TIMEOUT, "not everything was written and confirmed within the time given");
    }
    static_cast<void>(waiters_.wait(mutex_, deadline));
  }
}

}  // namespace gimnet::nif
