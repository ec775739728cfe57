#include "client/nif/message_sender.hpp"

#include <algorithm>
#include <new>
#include <string>

#include "base/clock.hpp"
#include "proto/frame/fragmenter.hpp"
#include "proto/frame/frame_header.hpp"
#include "proto/frame/window.hpp"

namespace gimnet::nif {
namespace {

/// The receiver of a message may leave its window closed this long before it is asked whether it
/// is still there.
constexpr std::int64_t kProbeNs = 1'000'000'000;

}  // namespace

inline bool MessageSender::may_go(const Outgoing& message, std::size_t frame_size,
                                  const SendProgress* own) {
  if (!parts_.writer.usable()) return false;
  if (own != nullptr ? own->stalled() : !parts_.under_way.may_begin(message)) return false;
  return parts_.gate.lets_in(message, frame_size);
}

/// Waits until the first frame of the message may enter the queue.
inline nif_status MessageSender::wait_for_turn(Outgoing& message, std::size_t frame_size,
                                               Deadline deadline, Mutex& mutex) {
  parts_.gate.redirect(message);
  const nif_status status = wait_until_it_may_go(message, frame_size, nullptr, deadline, mutex);
  parts_.gate.redirect(message);  // its service may have another group since it waits
  return status;
}

/// `own`: the message is under way already.
nif_status MessageSender::wait_until_it_may_go(const Outgoing& message, std::size_t frame_size,
                                               const SendProgress* own, Deadline deadline,
                                               Mutex& mutex) {
  std::int64_t probe_at = 0;
  for (;;) {
    const bool waits = parts_.queue.resume() && (own != nullptr || !message.not_while_away());
    if (parts_.connection.ended() || (parts_.connection.away() && !waits))
      return parts_.connection.not_connected();
    if (own != nullptr) {
      if (const nif_status status = parts_.under_way.check(*own); status != NIF_OK) return status;
    }
    if (parts_.connection.connected() && parts_.gate.refuses(message)) {
      return fail(NIF_REFUSED,
                  "the hub did not take the service again, after a break or another name");
    }
    if (may_go(message, frame_size, own)) return NIF_OK;
    // Messages that NIF_FLAG_MORE held back, or that were left to the library's thread, go before
    // anybody waits for room.
    if (parts_.writer.write_here(mutex)) continue;
    const std::int64_t now = steady_now_ns();
    if (now >= deadline) return parts_.connection.no_turn();
    const bool stalled = own != nullptr && own->stalled() && parts_.connection.connected();
    if (stalled && probe_at == 0) probe_at = now + kProbeNs;
    if (stalled && now >= probe_at) {
      parts_.frames.append_probe(own->dst);
      parts_.writer.write_or_leave(false, mutex);
      probe_at = now + kProbeNs;
    }
    static_cast<void>(
        parts_.waiters.wait(mutex, stalled ? std::min(deadline, probe_at) : deadline));
  }
}

/// For a message that has a fragment header.
std::uint32_t MessageSender::number_of(Outgoing& message, bool windowed) {
  const std::uint32_t number = parts_.frames.next_number();
  if (message.reported() || windowed || is_retained(message)) reported_.remember(number, message);
  return number;
}

nif_status MessageSender::send_whole(Outgoing& message, Deadline deadline, Mutex& mutex) {
  const bool with_header = proto::needs_fragment_header(message.size());
  const std::size_t frame = FrameAppender::frame_size(message, with_header, message.size());
  const nif_status turn = wait_for_turn(message, frame, deadline, mutex);
  if (turn != NIF_OK) return turn;
  std::optional<std::uint32_t> number;
  if (with_header) number = number_of(message, false);
  parts_.frames.append_whole(message, number);
  return NIF_OK;
}

nif_status MessageSender::send_pieces(Outgoing& message, SendProgress& progress, Deadline deadline,
                                      Mutex& mutex) {
  const std::uint32_t largest = parts_.frames.piece_max(message);
  const std::size_t frame = FrameAppender::frame_size(message, true, largest);
  proto::Fragmenter fragmenter(message.size(), largest);
  while (!fragmenter.done()) {
    const nif_status turn = wait_until_it_may_go(message, frame, &progress, deadline, mutex);
    if (turn == NIF_TIMEOUT && progress.number != 0) {
      parts_.under_way.hold(message, progress, fragmenter);
      return NIF_OK;
    }
    if (turn != NIF_OK) return turn;
    if (progress.number == 0)
      parts_.under_way.begin(message, progress, number_of(message, progress.windowed));
    parts_.frames.append_piece(message, progress, fragmenter);
    parts_.writer.write_or_leave(!fragmenter.done() || message.more(), mutex);
  }
  return NIF_OK;
}

nif_status MessageSender::send_fragments(Outgoing& message, Deadline deadline, Mutex& mutex) {
  const std::size_t frame = FrameAppender::frame_size(message, true, proto::kFragmentPayload);
  const nif_status turn = wait_for_turn(message, frame, deadline, mutex);
  if (turn != NIF_OK) return turn;
  SendProgress progress{.number = 0,
                        .dst = message.parts().header.dst,
                        .tag = message.tag(),
                        .windowed = message.parts().header.kind == proto::Kind::unicast &&
                                    message.size() > proto::kWindowDefault,
                        .window = proto::SendWindow(0, message.size())};
  parts_.under_way.add(message, progress);
  nif_status status = NIF_NO_MEMORY;
  try {
    status = send_pieces(message, progress, deadline, mutex);
  } catch (const std::bad_alloc&) {
    parts_.writer.give_up();
    status =
        fail(NIF_NO_MEMORY, "no memory for the message; if it had begun, its receiver lost it");
  }
  parts_.under_way.end(message, progress);
  parts_.waiters.notify();
  return status;
}

nif_status MessageSender::send(Outgoing& message, Deadline deadline, Mutex& mutex) {
  const bool whole = message.size() <= proto::kUncutMessageMax;
  reports_wanted_ |= message.reported();
  message.set_patient(deadline == kNever);
  const nif_status status =
      whole ? send_whole(message, deadline, mutex) : send_fragments(message, deadline, mutex);
  if (status != NIF_OK) return status;
  ++messages_sent_;
  const bool retained = is_retained(message);
  if (retained) parts_.last.keep(message);
  if (whole) parts_.writer.write_or_leave(message.more(), mutex);
  return retained ? check_retained(message) : NIF_OK;
}

/// The message went; does the hub keep it, as far as its WELCOME tells?
nif_status MessageSender::check_retained(Outgoing& message) const {
  const std::uint32_t data = message.application_bytes();
  if (!hub_retains_ || data <= *hub_retains_) return NIF_OK;
  return fail(NIF_NOT_RETAINED,
              "the hub does not keep the message of " + std::to_string(data) +
                  " bytes for those who subscribe later, only of " + std::to_string(*hub_retains_) +
                  " bytes and less; send less, or raise its limits retained_message_bytes and "
                  "retained_budget_bytes");
}

}  // namespace gimnet::nif
