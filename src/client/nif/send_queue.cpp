#include "client/nif/send_queue.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "base/check.hpp"

namespace gimnet::nif {
namespace {

/// The bytes of one lane before the others are looked at again.
constexpr std::size_t kTurnBytes = 16 * 1024;
/// A lane that waited while this much went is next: 1/16 of the bytes.
constexpr std::size_t kPassedOverMax = 15 * kTurnBytes;

}  // namespace

OutgoingStream latest_stream_of(const proto::FrameHeader& header,
                                std::optional<std::uint64_t> key) {
  const std::uint64_t rest = (std::uint64_t{key.has_value()} << 16) |
                             (static_cast<std::uint64_t>(header.kind) << 8) | header.lane;
  return {(rest << 32) | header.dst, key.value_or(0)};
}

void SendQueue::set_resume(bool on) { resume_ = on; }

bool SendQueue::has_room(std::size_t frame_size) {
  const bool queue_has_room =
      unsent_bytes_ == 0 || unsent_bytes_ + frame_size <= limits_.queue_bytes;
  if (!queue_has_room || !resume_) return queue_has_room;
  // Frames that wait will be kept, too, once they are written.
  return retained_.make_room(unsent_bytes_ + frame_size) ||
         (retained_.bytes() == 0 && unsent_bytes_ == 0);
}

SendQueue::Place SendQueue::allocate(std::size_t size) {
  if (!open_chunk_ || open_chunk_->capacity - open_chunk_->used < size) {
    open_chunk_ = pool_.take(size);
  }
  const std::size_t begin = open_chunk_->used;
  open_chunk_->used += size;
  return {open_chunk_, begin};
}

std::span<std::byte> SendQueue::append(std::uint8_t lane, std::size_t size) {
  GIMNET_CHECK(lane < lanes_.size() && size >= proto::kHeaderSize);
  Place place = allocate(size);
  Runs& runs = lanes_[lane];
  std::byte* memory = place.chunk->memory.get() + place.begin;
  const bool extends = !runs.empty() && runs.back().chunk == place.chunk &&
                       runs.back().end == place.begin && runs.back().sort == FrameRun::Sort::data;
  if (extends) {
    runs.back().end += size;
    ++runs.back().frames;
  } else {
    runs.push_back(
        {std::move(place.chunk), place.begin, place.begin + size, 1, lane, FrameRun::Sort::data});
  }
  unsent_bytes_ += size;
  return {memory, size};
}

std::span<std::byte> SendQueue::append_latest(std::uint8_t lane, std::size_t size,
                                              const OutgoingStream& stream) {
  GIMNET_CHECK(lane < lanes_.size() && size >= proto::kHeaderSize);
  Place place = allocate(size);
  const std::span<std::byte> memory{place.chunk->memory.get() + place.begin, size};
  if (const auto older = latest_.find(stream); older != latest_.end()) {
    FrameRun& run = *older->second;
    unsent_bytes_ = unsent_bytes_ - run.size() + size;
    run.chunk = std::move(place.chunk);
    run.begin = place.begin;
    run.end = place.begin + size;
    ++frames_replaced_;
    return memory;
  }
  Runs& runs = lanes_[lane];
  runs.push_back(
      {std::move(place.chunk), place.begin, place.begin + size, 1, lane, FrameRun::Sort::latest});
  latest_.emplace(stream, &runs.back());
  unsent_bytes_ += size;
  return memory;
}

std::span<std::byte> SendQueue::append_control(std::size_t size) {
  Place place = allocate(size);
  std::byte* memory = place.chunk->memory.get() + place.begin;
  control_.push_back(
      {std::move(place.chunk), place.begin, place.begin + size, 1, 0, FrameRun::Sort::control});
  unsent_bytes_ += size;
  return {memory, size};
}

/// Moves frames from the front of a list into the write.
void SendQueue::stage(Runs& from, std::size_t bytes_max) {
  FrameRun& front = from.front();
  if (front.sort == FrameRun::Sort::latest) {
    std::erase_if(latest_, [&front](const auto& entry) { return entry.second == &front; });
    front.sort = FrameRun::Sort::data;
  }
  FrameRun run = front.split_at_most(bytes_max);
  if (front.frames == 0) from.pop_front();
  staged_bytes_ += run.size();
  staged_.push_back(std::move(run));
}

std::optional<std::uint8_t> SendQueue::pick_lane() const {
  std::optional<std::uint8_t> first;
  for (std::uint8_t lane = 0; lane < proto::kLaneCount; ++lane) {
    if (lanes_[lane].empty()) continue;
    if (passed_over_[lane] >= kPassedOverMax) return lane;
    if (!first) first = lane;
  }
  return first;
}

void SendQueue::stage_lanes() {
  while (staged_.size() < kGatherPiecesMax && staged_bytes_ < kGatherBytesMax) {
    const auto lane = pick_lane();
    if (!lane) return;
    const bool others = std::any_of(lanes_.begin(), lanes_.end(), [&](const Runs& runs) {
      return &runs != &lanes_[*lane] && !runs.empty();
    });
    const std::size_t before = staged_bytes_;
    stage(lanes_[*lane], others ? kTurnBytes : kGatherBytesMax - staged_bytes_);
    passed_over_[*lane] = 0;
    for (std::size_t other = 0; other < lanes_.size(); ++other) {
      if (other != *lane && !lanes_[other].empty()) passed_over_[other] += staged_bytes_ - before;
    }
  }
}

void SendQueue::stage_first(Runs& from) {
  while (!from.empty() && staged_.size() < kGatherPiecesMax && staged_bytes_ < kGatherBytesMax) {
    stage(from, kGatherBytesMax - staged_bytes_);
  }
}

std::span<const iovec> SendQueue::gather() {
  stage_first(control_);
  stage_first(resend_);
  // Frames of the lanes are counted after all that is sent again.
  if (resend_.empty() && !held_back_) stage_lanes();
  std::size_t count = 0;
  std::size_t skip = first_written_;
  for (const FrameRun& run : staged_) {
    pieces_[count++] = {const_cast<std::byte*>(run.bytes() + skip), run.size() - skip};
    skip = 0;
  }
  return {pieces_.data(), count};
}

/// The run was written whole.
void SendQueue::finish(FrameRun run) {
  if (!run.counted()) return;
  frames_written_ += run.sort == FrameRun::Sort::resent ? 0 : run.frames;
  frames_resent_ += run.sort == FrameRun::Sort::resent ? run.frames : 0;
  retained_.written(std::move(run), resume_);
}

void SendQueue::commit(std::size_t bytes) {
  unsent_bytes_ -= bytes;
  std::size_t position = first_written_ + bytes;
  first_written_ = 0;
  while (!staged_.empty() && position > 0) {
    FrameRun& run = staged_.front();
    if (run.size() <= position) {
      position -= run.size();
      finish(std::move(run));
      staged_.pop_front();
      continue;
    }
    FrameRun whole = run.split_whole_before(position);
    position -= whole.size();
    if (whole.frames > 0) finish(std::move(whole));
    first_written_ = position;
    break;
  }
  return_staged();
}

/// Frames that were not begun go back where they came from, so that more urgent ones can still
/// overtake them.
void SendQueue::return_staged() {
  std::optional<FrameRun> begun;
  if (first_written_ > 0) {
    begun = staged_.front().split(staged_.front().first_size(), 1);
    if (staged_.front().frames == 0) staged_.pop_front();
  }
  while (!staged_.empty()) {
    FrameRun run = std::move(staged_.back());
    staged_.pop_back();
    Runs& home = run.sort == FrameRun::Sort::control  ? control_
                 : run.sort == FrameRun::Sort::resent ? resend_
                                                      : lanes_[run.lane];
    home.push_front(std::move(run));
  }
  staged_bytes_ = 0;
  if (begun) {
    staged_bytes_ = begun->size() - first_written_;
    staged_.push_back(std::move(*begun));
  }
}

bool SendQueue::confirm(std::uint64_t count) {
  std::uint64_t upcoming = 0;
  for (const FrameRun& run : staged_) upcoming += run.counted() ? run.frames : 0;
  return retained_.confirm(count, upcoming);
}

void SendQueue::disconnect() {
  if (!staged_.empty()) {
    FrameRun begun = std::move(staged_.front());
    staged_.clear();
    unsent_bytes_ += first_written_;
    if (begun.counted()) {
      resend_.push_front(std::move(begun));
    } else {
      unsent_bytes_ -= begun.size();
    }
  }
  first_written_ = 0;
  staged_bytes_ = 0;
  for (const FrameRun& run : control_) unsent_bytes_ -= run.size();
  control_.clear();
}

std::optional<std::uint64_t> SendQueue::resume_from(std::uint64_t peer_taken) {
  const auto missing = retained_.take_after(peer_taken, resend_);
  if (!missing) return std::nullopt;
  std::size_t again = 0;
  for (const FrameRun& run : resend_) again += run.size();
  unsent_bytes_ = again;
  for (const Runs& runs : lanes_) {
    for (const FrameRun& run : runs) unsent_bytes_ += run.size();
  }
  return missing;
}

void SendQueue::restart(std::uint32_t src) {
  retained_.restart();
  for (FrameRun& run : resend_) run.sort = FrameRun::Sort::data;
  // A message that was begun on the old connection leads its lane again.
  while (!resend_.empty()) {
    FrameRun run = std::move(resend_.back());
    resend_.pop_back();
    lanes_[run.lane].push_front(std::move(run));
  }
  // Runs change their places: what was to be replaced goes as it is.
  latest_.clear();
  for (Runs& runs : lanes_) {
    for (FrameRun& run : runs) run.sort = FrameRun::Sort::data;
  }
  const auto change = [src](FrameRun& run) {
    run.change_headers([src](proto::FrameHeader& header) { header.src = src; });
  };
  for (Runs& runs : lanes_) std::for_each(runs.begin(), runs.end(), change);
  held_back_ = unsent_bytes_ > 0;
}

std::uint64_t SendQueue::go_on(const GroupMap& moves) {
  held_back_ = false;
  latest_.clear();  // runs change their places
  std::uint64_t dropped = 0;
  for (Runs& lane : lanes_) {
    Runs kept;
    for (FrameRun& run : lane) {
      while (run.frames > 0) {
        FrameRun frame = run.split(run.first_size(), 1);
        frame.sort = FrameRun::Sort::data;
        const proto::FrameHeader header = frame.first_header();
        const bool grouped = header.kind == proto::Kind::group;
        const auto moved =
            grouped || header.kind == proto::Kind::service ? moves.find(header.dst) : moves.end();
        if (moved == moves.end() ? grouped : moved->second == 0) {
          unsent_bytes_ -= frame.size();
          ++dropped;
          continue;
        }
        if (moved != moves.end())
          frame.change_headers([&](proto::FrameHeader& each) { each.dst = moved->second; });
        if (kept.empty() || !kept.back().extend(frame)) kept.push_back(std::move(frame));
      }
    }
    lane.swap(kept);
  }
  return dropped;
}

std::uint64_t SendQueue::drop_all() noexcept {
  std::uint64_t frames = 0;
  for (const FrameRun& run : staged_) frames += run.counted() ? run.frames : 0;
  staged_.clear();
  staged_bytes_ = 0;
  first_written_ = 0;
  control_.clear();
  for (const FrameRun& run : resend_) frames += run.frames;
  resend_.clear();
  for (Runs& runs : lanes_) {
    for (const FrameRun& run : runs) frames += run.frames;
    runs.clear();
  }
  latest_.clear();
  held_back_ = false;
  retained_.restart();
  unsent_bytes_ = 0;
  return frames;
}

}  // namespace gimnet::nif
