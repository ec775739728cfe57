#include "client/nif/messages_under_way.hpp"

#include <string>

#include "client/nif/error.hpp"
#include "client/nif/pause_table.hpp"
#include "client/nif/reported_messages.hpp"

namespace gimnet::nif {

void MessagesUnderWay::begin(const Outgoing& message, SendProgress& progress,
                             std::uint32_t number) const {
  progress.number = number;
  progress.epoch = epoch_;
  progress.window = proto::SendWindow(number, message.size());
}

void MessagesUnderWay::hold(Outgoing& message, const SendProgress& progress,
                            const proto::Fragmenter& fragmenter) {
  by_stream_[message.stream()] = &held_.hold(message, progress, fragmenter).progress;
}

/// Another progress in its place: the rest is held.
void MessagesUnderWay::end(const Outgoing& message, const SendProgress& progress) {
  const auto place = by_stream_.find(message.stream());
  if (place->second == &progress) by_stream_.erase(place);
}

nif_status MessagesUnderWay::check(const SendProgress& progress) const {
  if (progress.undelivered != proto::DropReason::none) {
    return fail(NIF_NOT_DELIVERED, std::string("the hub reported ") +
                                       proto::drop_reason_name(progress.undelivered) +
                                       " while the message was being sent");
  }
  if (progress.refused && progress.window.taken() == 0) {
    return fail(NIF_TOO_LARGE, "the receiver refused the message: it is larger than it takes");
  }
  if (progress.refused)
    return fail(NIF_NOT_DELIVERED, "the receiver lost a part of the message and gave it up");
  if (progress.number != 0 && progress.epoch != epoch_) {
    return fail(NIF_NOT_CONNECTED,
                "the connection broke in the middle of the message; its receiver lost it");
  }
  return NIF_OK;
}

bool MessagesUnderWay::goes_on(const proto::FrameHeader& header) const {
  const auto found = by_stream_.find(stream_code(header.kind, header.lane, header.dst));
  return found != by_stream_.end() && found->second->number != 0 && found->second->epoch == epoch_;
}

MessagesUnderWay::Put MessagesUnderWay::put_held(SendGate& gate, FrameAppender& frames) {
  Put all;
  for (auto each = held_.begin(); each != held_.end();) {
    if (!put(*each, gate, frames, all)) {
      ++each;
      continue;
    }
    all.ended = true;
    by_stream_.erase(each->message->stream());
    each = held_.erase(each);
  }
  return all;
}

/// True: nothing of it is left, or it is lost.
bool MessagesUnderWay::put(HeldMessage& held, SendGate& gate, FrameAppender& frames,
                           Put& all) const {
  Outgoing& message = *held.message;
  const std::size_t frame = FrameAppender::frame_size(message, true, frames.piece_max(message));
  while (!held.fragmenter.done()) {
    if (held.progress.lost(epoch_)) return true;
    if (held.progress.stalled() || !gate.lets_in(message, frame)) return false;
    if (gate.refuses(message)) {
      all.lost = true;
      return true;
    }
    frames.append_piece(message, held.progress, held.fragmenter);
  }
  return true;
}

void MessagesUnderWay::ask_for_receivers(FrameAppender& frames) const {
  for (const HeldMessage& held : held_) {
    if (held.progress.stalled()) frames.append_probe(held.progress.dst);
  }
}

bool MessagesUnderWay::drop_held() {
  const bool lost = !held_.empty();
  for (const HeldMessage& held : held_) by_stream_.erase(held.message->stream());
  held_.clear();
  return lost;
}

bool MessagesUnderWay::begin_epoch() {
  ++epoch_;
  return drop_held();
}

std::optional<proto::Report> MessagesUnderWay::on_taken(std::uint32_t from,
                                                        const proto::Taken& taken) {
  auto report = held_.empty() ? std::nullopt : held_.report_of(from, taken);
  for (auto& [stream, progress] : by_stream_) {
    if (progress->number != taken.message || progress->dst != from || !progress->windowed) continue;
    static_cast<void>(progress->window.on_taken(taken));
    progress->refused |= taken.refuses();
  }
  return report;
}

void MessagesUnderWay::on_report(const proto::Report& report) {
  const proto::FrameHeader& header = report.header;
  if (header.kind == proto::Kind::taken) {
    // Our own TAKENs ask for no reports, so this answers FrameAppender::append_probe().
    for (auto& [stream, progress] : by_stream_) {
      if (progress->windowed && progress->dst == header.dst) progress->undelivered = report.reason;
    }
    return;
  }
  const auto found = by_stream_.find(stream_code(header.kind, header.lane, header.dst));
  if (found == by_stream_.end() || !header.has(proto::kFlagFragment)) return;
  SendProgress& progress = *found->second;
  const auto number = ReportedMessages::number_of(report);
  if (!progress.windowed || (number && *number != progress.number)) return;
  // Why the rest of a message goes is what became of its beginning.
  const bool rest = report.reason == proto::DropReason::cut_message;
  if (!rest || progress.undelivered == proto::DropReason::none)
    progress.undelivered = report.reason;
}

void MessagesUnderWay::refuse(std::uint64_t tag) {
  for (auto& [stream, progress] : by_stream_) progress->refused |= progress->tag == tag;
}

}  // namespace gimnet::nif
