#include "hub/data/egress/resume_buffer.hpp"

#include <algorithm>

namespace gimnet::hub {

bool ResumeBuffer::make_room(std::uint64_t planned, std::uint32_t size,
                             const CountedGroups* counted, std::uint64_t bytes_most) {
  const std::uint64_t most = std::min(bytes_max_, bytes_most);
  if (planned + size > most) return false;
  while (bytes_ + planned + size > most) {
    if (!front_may_go(counted)) return false;
    let_front_frame_go();
  }
  return true;
}

void ResumeBuffer::let_go(std::uint64_t bytes, const CountedGroups* counted) {
  const std::uint64_t least = bytes_ - std::min(bytes_, bytes);
  while (bytes_ > least && front_may_go(counted)) let_front_frame_go();
}

bool ResumeBuffer::front_may_go(const CountedGroups* counted) {
  if (kept_.empty()) return false;
  const proto::FrameHeader front = kept_.front().header();
  if (proto::is_block(front)) return false;
  // Nobody could say how many messages of a group a gap has.
  return counted == nullptr || front.kind != proto::Kind::group ||
         !counted->counts(GroupId{front.dst});
}

void ResumeBuffer::wrote(Run run) {
  written_ += run.frames;
  kept_frames_ += run.frames;
  bytes_ += run.size;
  if (kept_.empty() || !kept_.back().extend(run)) kept_.push_back(std::move(run));
}

std::uint64_t ResumeBuffer::confirm(std::uint64_t count) {
  if (count > written_ || count <= confirmed_) return 0;
  const std::uint64_t counted = std::max(confirmed_, lost_below_);
  confirmed_ = count;
  release_below(count);
  return count > counted ? count - counted : 0;
}

ResumeBuffer::Rewind ResumeBuffer::rewind(std::uint64_t count, RunQueue& replay) {
  Rewind result;
  if (count > written_ || count < confirmed_) return result;
  result.possible = true;
  result.confirmed = confirm(count);
  const std::uint64_t first = first_kept();
  result.gap = first - count;
  // A SKIP may be lost with the connection that carried it: then the gap is announced again, but
  // lost only once.
  result.lost = first - std::max(count, std::min(lost_below_, first));
  lost_below_ = std::max(lost_below_, first);
  while (!kept_.empty()) {
    replay.push(std::move(kept_.front()));
    kept_.pop_front();
  }
  written_ -= kept_frames_;
  kept_frames_ = 0;
  bytes_ = 0;
  return result;
}

void ResumeBuffer::let_front_frame_go() {
  Run& front = kept_.front();
  bytes_ -= front.skip_frame();
  --kept_frames_;
  if (front.frames == 0) kept_.pop_front();
}

void ResumeBuffer::release_below(std::uint64_t count) {
  while (!kept_.empty() && first_kept() < count) {
    Run& front = kept_.front();
    if (first_kept() + front.frames <= count) {
      kept_frames_ -= front.frames;
      bytes_ -= front.size;
      kept_.pop_front();
    } else {
      let_front_frame_go();
    }
  }
}

}  // namespace gimnet::hub
