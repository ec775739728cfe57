#include "client/nif/frame_run.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace gimnet::nif {

void RetainedFrames::written(FrameRun run, bool keep) {
  const std::uint32_t frames = run.frames;
  const std::size_t bytes = run.size();
  if (!keep) {
    next_ += frames;
    return;
  }
  // Not across lanes: without a resume each run goes back into its own.
  const bool extends = !runs_.empty() && runs_.back().lane == run.lane &&
                       runs_.back().chunk == run.chunk && runs_.back().end == run.begin;
  if (extends) {
    runs_.back().end = run.end;
    runs_.back().frames += run.frames;
  } else {
    runs_.push_back(std::move(run));
  }
  next_ += frames;
  frames_ += frames;
  bytes_ += bytes;
  if (confirmed_ > first()) drop_front(std::min(confirmed_, next_) - first());
}

bool RetainedFrames::confirm(std::uint64_t count, std::uint64_t upcoming) {
  if (count > next_ + upcoming) return false;
  confirmed_ = std::max(confirmed_, count);
  if (confirmed_ > first()) drop_front(std::min(confirmed_, next_) - first());
  return true;
}

void RetainedFrames::drop_front(std::uint64_t count) {
  while (count > 0 && !runs_.empty()) {
    FrameRun& run = runs_.front();
    if (run.frames <= count) {
      count -= run.frames;
      frames_ -= run.frames;
      bytes_ -= run.size();
      runs_.pop_front();
      continue;
    }
    for (; count > 0; --count) {
      bytes_ -= run.split(run.first_size(), 1).size();
      --frames_;
    }
  }
}

bool RetainedFrames::make_room(std::size_t more) {
  while (bytes_ + more > bytes_max_ && !runs_.empty() &&
         !proto::is_block(runs_.front().first_header())) {
    drop_front(1);
    ++let_go_;
  }
  return bytes_ + more <= bytes_max_;
}

std::optional<std::uint64_t> RetainedFrames::take_after(std::uint64_t peer_taken,
                                                        std::deque<FrameRun>& again) {
  if (peer_taken > next_) return std::nullopt;
  const std::uint64_t missing = first() > peer_taken ? first() - peer_taken : 0;
  if (peer_taken > first()) drop_front(peer_taken - first());
  next_ = first();
  for (FrameRun& run : runs_) run.sort = FrameRun::Sort::resent;
  again.insert(again.begin(), std::make_move_iterator(runs_.begin()),
               std::make_move_iterator(runs_.end()));
  runs_.clear();
  frames_ = 0;
  bytes_ = 0;
  confirmed_ = std::min(confirmed_, next_);
  return missing;
}

void RetainedFrames::restart() {
  runs_.clear();
  frames_ = 0;
  bytes_ = 0;
  next_ = 0;
  confirmed_ = 0;
}

}  // namespace gimnet::nif
