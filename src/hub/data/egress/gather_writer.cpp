#include "hub/data/egress/gather_writer.hpp"

#include <algorithm>

#include "proto/frame/extensions.hpp"
#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {
namespace {

/// A waiting lane gets at least this part of the bytes.
constexpr std::uint32_t kLaneShare = 16;

/// Looks at the extensions of a frame whose turn has come: stamps a TRACE, and returns false if an
/// AGE says that it is not worth sending any more. The bytes are this recipient's own copy.
bool still_worth_sending(const Entry& entry, HubId hub, std::int64_t now_ns) {
  const auto frame = proto::parse_frame({entry.run.bytes, entry.run.size}, proto::Origin::hub);
  if (!frame) return true;
  const auto age = proto::find_age(frame->extensions);
  if (age && proto::too_old(*age, now_ns)) return false;
  const std::span<std::byte> own(const_cast<std::byte*>(frame->extensions.data()),
                                 frame->extensions.size());
  static_cast<void>(proto::stamp_departure(own, hub, now_ns));
  return true;
}

/// Half of the connection's share, if it has one: the other half stays for what waits until room is
/// confirmed.
std::uint64_t resume_bytes_most(const Outbox& outbox, EgressContext& context) {
  return outbox.has_share(context) ? outbox.budget(context).share_bytes() / 2 : UINT64_MAX;
}

}  // namespace

void GatherWriter::Batch::add(Source source, const std::byte* begin, std::uint32_t size) {
  picks[pick_count++] = {source, size};
  bytes += size;
  if (piece_count != 0) {
    iovec& last = pieces[piece_count - 1];
    if (static_cast<const std::byte*>(last.iov_base) + last.iov_len == begin) {
      last.iov_len += size;
      return;
    }
  }
  pieces[piece_count++] = {const_cast<std::byte*>(begin), size};
}

Flush GatherWriter::flush(Outbox& outbox, ResumeBuffer* resume, net::Stream& transport,
                          EgressContext& context) {
  context.owner.check_here();
  Job job{outbox, resume, context};
  for (int round = 0; round < kBatchesPerTurn; ++round) {
    Batch batch;
    gather(batch, job);
    if (batch.bytes == 0) return outbox.empty() ? Flush::emptied : Flush::waits;
    const net::IoResult result = transport.send({batch.pieces.data(), batch.piece_count});
    ++context.tally.send_calls;
    if (result.status == net::IoStatus::would_block) return Flush::blocked;
    if (result.status != net::IoStatus::ok) return Flush::failed;
    context.tally.sent_bytes += result.bytes;
    consume(batch, result.bytes, job);
    if (result.bytes < batch.bytes) return Flush::blocked;
    if (outbox.empty() && !in_frame()) return Flush::emptied;
  }
  return Flush::more;
}

Run GatherWriter::take_partial() {
  partial_.offset = 0;
  if (partial_.control) partial_ = Partial{};
  return std::exchange(partial_, Partial{}).run;
}

// ---- gather
// -------------------------------------------------------------------------------------------------

void GatherWriter::gather(Batch& batch, Job& job) {
  if (in_frame()) {
    batch.add(Source::partial, partial_.run.bytes + partial_.offset,
              partial_.run.size - partial_.offset);
  }
  gather_queue(batch, Source::control, job.outbox.control().runs(), job);
  if (!job.outbox.has_lanes()) return;
  RunQueue& replay = job.outbox.replay();
  if (!replay.empty()) {
    gather_queue(batch, Source::replay, replay.runs(), job);
    // Frames that the peer missed come before anything newer.
    return;
  }
  gather_lanes(batch, job);
}

void GatherWriter::gather_queue(Batch& batch, Source source, RingQueue<Run>& queue, Job& job) {
  for (std::uint64_t number = queue.first_number(); number != queue.end_number() && !batch.full();
       ++number) {
    const Run& run = queue.at(number);
    const std::uint32_t size =
        source == Source::control ? run.size : allowed(run, batch.bytes, job);
    if (size != 0) batch.add(source, run.bytes, size);
    if (size < run.size) return;
  }
}

void GatherWriter::gather_lanes(Batch& batch, Job& job) {
  std::array<LaneCursor, proto::kLaneCount> cursors;
  std::size_t filled = 0;
  std::size_t only = 0;
  for (std::size_t lane = 0; lane < cursors.size(); ++lane) {
    const RingQueue<Entry>& entries = job.outbox.lane(lane).entries();
    if (entries.empty()) continue;
    cursors[lane].number = entries.first_number();
    load(cursors[lane], lane, job);
    ++filled;
    only = lane;
  }
  if (filled == 1) return gather_lane(batch, only, cursors[only], job);
  while (!batch.full()) {
    const std::size_t lane = choose_lane(cursors, job.outbox);
    if (lane == proto::kLaneCount) return;
    const Run& run = *cursors[lane].run;
    const std::uint32_t size = allowed(run, batch.bytes, job);
    if (size != 0)
      batch.add(static_cast<Source>(static_cast<std::size_t>(Source::lane0) + lane), run.bytes,
                size);
    owe(lane, size, cursors, job.outbox);
    if (size < run.size) return;
    advance(cursors[lane], lane, job);
  }
}

/// The usual case: nobody else waits, so nobody is owed anything.
void GatherWriter::gather_lane(Batch& batch, std::size_t lane, LaneCursor& cursor, Job& job) {
  std::uint64_t& owed = job.outbox.owed()[lane];
  while (cursor.run != nullptr && !batch.full()) {
    const Run& run = *cursor.run;
    const std::uint32_t size = allowed(run, batch.bytes, job);
    if (size != 0)
      batch.add(static_cast<Source>(static_cast<std::size_t>(Source::lane0) + lane), run.bytes,
                size);
    owed -= std::min<std::uint64_t>(owed, size);
    if (size < run.size) return;
    advance(cursor, lane, job);
  }
}

void GatherWriter::load(LaneCursor& cursor, std::size_t lane, Job& job) {
  RingQueue<Entry>& entries = job.outbox.lane(lane).entries();
  for (; cursor.number < entries.end_number(); ++cursor.number) {
    Entry& entry = entries.at(cursor.number);
    if (entry.frames == 0) continue;
    if (entry.extended && !entry.touched &&
        !still_worth_sending(entry, job.context.hub, job.context.now_wall_ns)) {
      job.outbox.lane(lane).on_left(entry, entry.size);
      job.outbox.lose(entry, proto::DropReason::too_old, job.context);
      continue;
    }
    cursor.run = &entry.run;
    cursor.more = entry.more.get();
    return;
  }
  cursor.run = nullptr;
}

void GatherWriter::advance(LaneCursor& cursor, std::size_t lane, Job& job) {
  if (cursor.more != nullptr) {
    cursor.run = &cursor.more->run;
    cursor.more = cursor.more->next.get();
    return;
  }
  ++cursor.number;
  load(cursor, lane, job);
}

std::size_t GatherWriter::choose_lane(std::array<LaneCursor, proto::kLaneCount>& cursors,
                                      Outbox& outbox) {
  for (std::size_t lane = 1; lane < cursors.size(); ++lane) {
    if (cursors[lane].run != nullptr && outbox.owed()[lane] >= cursors[lane].run->size) return lane;
  }
  for (std::size_t lane = 0; lane < cursors.size(); ++lane) {
    if (cursors[lane].run != nullptr) return lane;
  }
  return cursors.size();
}

void GatherWriter::owe(std::size_t lane, std::uint32_t bytes,
                       std::array<LaneCursor, proto::kLaneCount>& cursors, Outbox& outbox) {
  auto& owed = outbox.owed();
  owed[lane] -= std::min<std::uint64_t>(owed[lane], bytes);
  for (std::size_t lower = lane + 1; lower < cursors.size(); ++lower) {
    if (cursors[lower].run != nullptr) owed[lower] += 1 + bytes / kLaneShare;
  }
}

std::uint32_t GatherWriter::allowed(const Run& run, std::size_t planned, Job& job) {
  if (job.resume == nullptr) return run.size;
  const CountedGroups* counted = job.outbox.counted_groups();
  const std::uint64_t most = resume_bytes_most(job.outbox, job.context);
  if (job.resume->make_room(planned, run.size, counted, most)) return run.size;
  std::uint32_t size = 0;
  for (std::uint32_t frame = 0; frame < run.frames; ++frame) {
    const auto next = static_cast<std::uint32_t>(proto::load_header(run.bytes + size).frame_size());
    // A frame larger than the buffer is kept alone.
    if (planned + size == 0 && next > most) job.resume->let_go(UINT64_MAX, counted);
    const bool alone = planned + size == 0 && job.resume->bytes() == 0;
    if (!alone && !job.resume->make_room(planned + size, next, counted, most)) break;
    size += next;
  }
  return size;
}

// ---- consume
// -------------------------------------------------------------------------------------------------

void GatherWriter::consume(const Batch& batch, std::size_t bytes, Job& job) {
  for (std::size_t i = 0; i < batch.pick_count && bytes != 0; ++i) {
    const Pick& pick = batch.picks[i];
    const std::size_t taken = std::min<std::size_t>(bytes, pick.bytes);
    bytes -= taken;
    switch (pick.source) {
      case Source::partial:
        if (partial_.control) job.context.tally.sent_control_bytes += taken;
        consume_partial(taken, job);
        break;
      case Source::control:
        job.context.tally.sent_control_bytes += taken;
        consume_queue(job.outbox.control(), taken, true, job);
        break;
      case Source::replay:
        consume_queue(job.outbox.replay(), taken, false, job);
        break;
      default:
        consume_lane(
            static_cast<std::size_t>(pick.source) - static_cast<std::size_t>(Source::lane0), taken,
            job);
    }
  }
}

void GatherWriter::consume_partial(std::size_t bytes, Job& job) {
  partial_.offset += static_cast<std::uint32_t>(bytes);
  if (partial_.offset < partial_.run.size) return;
  Partial whole = std::exchange(partial_, Partial{});
  finish(std::move(whole.run), whole.control, whole.shared, job);
}

/// Takes `bytes` from the front of `run`: whole frames are finished, one that was begun becomes the
/// partial frame. Returns the bytes that left the run.
std::uint32_t GatherWriter::consume_run(Run& run, std::size_t bytes, bool control, bool shared,
                                        Job& job) {
  if (bytes >= run.size) {
    const std::uint32_t size = run.size;
    finish(std::exchange(run, Run{}), control, shared, job);
    return size;
  }
  Run whole = run.share();
  whole.size = whole.frames = 0;
  while (run.header().frame_size() <= bytes - whole.size) {
    whole.size += run.skip_frame();
    ++whole.frames;
  }
  std::uint32_t left = whole.size;
  if (whole.size < bytes) {
    partial_.run = run.take_frame();
    partial_.offset = static_cast<std::uint32_t>(bytes - whole.size);
    partial_.control = control;
    partial_.shared = shared;
    left += partial_.run.size;
    // A frame that was begun stays until the transport takes the rest.
    job.outbox.settle_run(partial_.run, shared, job.context);
  }
  if (whole.frames != 0) finish(std::move(whole), control, shared, job);
  return left;
}

void GatherWriter::consume_queue(RunQueue& queue, std::size_t bytes, bool control, Job& job) {
  Run& run = queue.runs().front();
  queue.on_left(consume_run(run, bytes, control, false, job));
  if (run.frames == 0) queue.runs().pop_front();
}

void GatherWriter::consume_lane(std::size_t lane, std::size_t bytes, Job& job) {
  LaneQueue& queue = job.outbox.lane(lane);
  Entry& entry = queue.front();
  const std::uint32_t frames_before = entry.run.frames;
  const std::uint32_t left = consume_run(entry.run, bytes, false, entry.shared, job);
  queue.on_left(entry, left);
  entry.size -= left;
  entry.frames -= frames_before - entry.run.frames;
  queue.touch(entry);
  if (entry.run.frames == 0 && !entry.next_piece()) {
    entry.frames = 0;
    queue.pop_front();
  }
}

void GatherWriter::finish(Run run, bool control, bool shared, Job& job) {
  if (control) return;
  Tally& tally = job.context.tally;
  if (job.resume == nullptr) {
    tally.delivered += run.frames;
    tally.queued -= run.frames;
    return;
  }
  if (job.outbox.budget(job.context).scarce()) return keep_in_pieces(std::move(run), shared, job);
  job.outbox.settle_run(run, shared, job.context);
  job.resume->wrote(std::move(run));
}

/// Frame by frame into chunks: frames are let go one by one, and a long copy would stay for the
/// last of them.
void GatherWriter::keep_in_pieces(Run run, bool shared, Job& job) {
  while (run.frames != 0) {
    Run frame = run.take_frame();
    job.outbox.settle_run(frame, shared, job.context);
    job.resume->wrote(std::move(frame));
  }
}

}  // namespace gimnet::hub
