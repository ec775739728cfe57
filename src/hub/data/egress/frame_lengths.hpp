#pragma once

#include <cstddef>
#include <cstdint>

#include "hub/data/egress/frame_starts.hpp"
#include "hub/data/egress/run.hpp"

// How many frames at the front of a run come to so many bytes, and the other way round: without
// looking at them where all are equally long, and else by `starts`, so that a long run to many full
// queues costs each of them about as much as a short one. No frame of the run is shorter than
// `shortest_bytes`, header included; a header's size holds for all runs. Thread safety: one shard.

namespace gimnet::hub {

[[nodiscard]] inline bool equally_long(std::uint32_t size, std::uint32_t frames,
                                       std::uint32_t shortest_bytes) {
  return std::uint64_t{shortest_bytes} * frames == size;
}

/// The frames at the front of which takes(those before, bytes of the next one) is true, one after
/// the other.
template <class Takes>
[[nodiscard]] Leading leading_frames(const Run& run, Takes&& takes) {
  Leading leading;
  while (leading.frames != run.frames) {
    const auto next =
        static_cast<std::uint32_t>(proto::load_header(run.bytes + leading.size).frame_size());
    if (!takes(leading, next)) break;
    leading.size += next;
    ++leading.frames;
  }
  return leading;
}

/// Fewer frames than this are looked at one by one: quicker than to look for the starts of all.
inline constexpr std::uint32_t kFewFrames = FrameStarts::kFramesMin;

/// So many; all if there are not more.
[[nodiscard]] inline Leading leading_frames_of(const Run& run, std::uint32_t shortest_bytes,
                                               std::uint64_t frames, FrameStarts& starts) {
  if (run.frames <= frames) return {run.frames, run.size};
  const auto most = static_cast<std::uint32_t>(frames);
  if (equally_long(run.size, run.frames, shortest_bytes)) return {most, most * shortest_bytes};
  const auto* known = most < kFewFrames ? nullptr : starts.find(run);
  if (known != nullptr) return known->leading_frames(run, most);
  return leading_frames(run,
                        [&](const Leading& before, std::uint32_t) { return before.frames < most; });
}

/// As few as come to `bytes` or more; all if they do not.
[[nodiscard]] inline Leading leading_from(const Run& run, std::uint32_t shortest_bytes,
                                          std::uint64_t bytes, FrameStarts& starts) {
  if (run.size <= bytes) return {run.frames, run.size};
  if (equally_long(run.size, run.frames, shortest_bytes)) {
    const auto frames = static_cast<std::uint32_t>((bytes + shortest_bytes - 1) / shortest_bytes);
    return {frames, frames * shortest_bytes};
  }
  const auto* known =
      bytes < std::uint64_t{kFewFrames} * shortest_bytes ? nullptr : starts.find(run);
  if (known != nullptr) return known->leading_from(run, bytes);
  return leading_frames(run,
                        [&](const Leading& before, std::uint32_t) { return before.size < bytes; });
}

/// As many as come to `bytes` or less.
[[nodiscard]] inline Leading leading_within(const Run& run, std::uint32_t shortest_bytes,
                                            std::uint64_t bytes, FrameStarts& starts) {
  if (run.size <= bytes) return {run.frames, run.size};
  if (shortest_bytes > bytes) return {};
  if (equally_long(run.size, run.frames, shortest_bytes)) {
    const auto frames = static_cast<std::uint32_t>(bytes / shortest_bytes);
    return {frames, frames * shortest_bytes};
  }
  const auto* known =
      bytes < std::uint64_t{kFewFrames} * shortest_bytes ? nullptr : starts.find(run);
  if (known != nullptr) return known->leading_within(run, bytes);
  return leading_frames(
      run, [&](const Leading& before, std::uint32_t next) { return before.size + next <= bytes; });
}

/// Those before the first that is longer than `bytes`.
[[nodiscard]] inline Leading leading_up_to(const Run& run, std::uint32_t shortest_bytes,
                                           std::uint64_t bytes) {
  const std::uint64_t longest = run.size - std::uint64_t{shortest_bytes} * (run.frames - 1);
  if (longest <= bytes) return {run.frames, run.size};
  return leading_frames(run, [&](const Leading&, std::uint32_t next) { return next <= bytes; });
}

/// Those before the first that is not longer than `bytes`.
[[nodiscard]] inline Leading leading_beyond(const Run& run, std::uint32_t shortest_bytes,
                                            std::uint64_t bytes) {
  if (shortest_bytes > bytes) return {run.frames, run.size};
  return leading_frames(run, [&](const Leading&, std::uint32_t next) { return next > bytes; });
}

/// The last frame. REQUIRES: there is one.
[[nodiscard]] inline const std::byte* last_frame(const Run& run, std::uint32_t shortest_bytes,
                                                 FrameStarts& starts) {
  const std::byte* const end = run.bytes + run.size;
  if (equally_long(run.size, run.frames, shortest_bytes)) return end - shortest_bytes;
  if (const auto* known = starts.find(run)) return known->last(run);
  const std::byte* last = run.bytes;
  for (const std::byte* next = last; next != end; next += proto::load_header(next).frame_size())
    last = next;
  return last;
}

/// All but the last one. REQUIRES: there is one.
[[nodiscard]] inline Leading all_but_last(const Run& run, std::uint32_t shortest_bytes,
                                          FrameStarts& starts) {
  const std::byte* const last = last_frame(run, shortest_bytes, starts);
  return {run.frames - 1, static_cast<std::uint32_t>(last - run.bytes)};
}

}  // namespace gimnet::hub
