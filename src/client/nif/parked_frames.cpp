#include "client/nif/parked_frames.hpp"

#include <ranges>
#include <utility>

namespace gimnet::nif {
namespace {

/// Frames at the front of the run that are not GROUP frames, or are all for one group.
FrameRun split_alike(FrameRun& run) {
  const proto::FrameHeader first = run.first_header();
  const bool is_group = first.kind == proto::Kind::group;
  std::size_t size = first.frame_size();
  std::uint32_t count = 1;
  for (; count < run.frames; ++count) {
    const proto::FrameHeader next = proto::load_header(run.bytes() + size);
    if ((next.kind == proto::Kind::group) != is_group || (is_group && next.dst != first.dst)) break;
    size += next.frame_size();
  }
  return run.split(size, count);
}

}  // namespace

void ParkedFrames::take_from(Lanes& lanes) {
  for (Runs& lane : lanes) {
    Runs others;
    for (FrameRun& run : lane) {
      while (run.frames > 0) {
        FrameRun alike = split_alike(run);
        const bool is_group = alike.first_header().kind == proto::Kind::group;
        if (is_group) bytes_ += alike.size();
        (is_group ? runs_ : others).push_back(std::move(alike));
      }
    }
    lane.swap(others);
  }
}

std::size_t ParkedFrames::give_back(std::uint32_t former, std::uint32_t now, Lanes& lanes) {
  std::size_t bytes = 0;
  // From the last on, so that the first is in front.
  for (FrameRun& run : std::views::reverse(runs_)) {
    if (run.first_header().dst != former) continue;
    run.change_headers([now](proto::FrameHeader& header) { header.dst = now; });
    bytes += run.size();
    lanes[run.lane].push_front(run.split(run.size(), run.frames));
  }
  std::erase_if(runs_, [](const FrameRun& run) { return run.frames == 0; });
  bytes_ -= bytes;
  return bytes;
}

void ParkedFrames::set_source(std::uint32_t src) {
  for (FrameRun& run : runs_) {
    run.change_headers([src](proto::FrameHeader& header) { header.src = src; });
  }
}

std::uint64_t ParkedFrames::drop() noexcept {
  std::uint64_t frames = 0;
  for (const FrameRun& run : runs_) frames += run.frames;
  runs_.clear();
  bytes_ = 0;
  return frames;
}

}  // namespace gimnet::nif
