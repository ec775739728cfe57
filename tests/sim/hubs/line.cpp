#include "tests/sim/hubs/line.hpp"

#include <algorithm>

#include "proto/control/link.hpp"

namespace gimnet::sim::hubs {
namespace {

using std::chrono::milliseconds;

/// Bytes that the kernels of both ends and the way between them hold.
constexpr std::size_t kWindow = 256 * 1024;
/// Bytes that wait at one end.
constexpr std::size_t kRoom = 64 * 1024;
constexpr std::uint64_t kBurstMs = 20;

}  // namespace

Flow::Flow(const WirePlan& way, hub::MemoryPeer from, bool opens)
    : way_(way), from_(std::move(from)), skip_(opens ? proto::kOpeningSize : 0) {
  from_.set_room(kRoom);
}

void Flow::take(Random& random, milliseconds now, const Tap& tap) {
  // The kernel keeps what waits unsent below that.
  const std::size_t most_unsent = from_.unsent_limit();
  from_.set_room(most_unsent == 0 ? kRoom : std::min(kRoom, most_unsent));
  if (way_.bytes_per_ms != 0)
    allowed_ = std::min(allowed_ + way_.bytes_per_ms, kBurstMs * way_.bytes_per_ms);
  if (from_.readable() != 0) {
    const std::size_t window = kWindow + 2 * way_.delay_ms * way_.bytes_per_ms;
    std::size_t most = window - std::min(window, bytes_);
    if (way_.bytes_per_ms != 0) most = std::min(most, static_cast<std::size_t>(allowed_));
    Piece piece;
    if (most != 0) from_.read(piece.bytes, most);
    if (piece.bytes.empty()) return;
    if (way_.bytes_per_ms != 0) allowed_ -= piece.bytes.size();
    if (spoils_ && frames_.empty()) spoil(piece.bytes);
    frames_.insert(frames_.end(), piece.bytes.begin(), piece.bytes.end());
    look(tap);
    piece.at = last_ =
        std::max(last_, now + milliseconds{way_.delay_ms + random.below(way_.jitter_ms + 1)});
    bytes_ += piece.bytes.size();
    under_way_.push_back(std::move(piece));
  } else if (from_.transport_gone() && !says_end_) {
    says_end_ = true;
    under_way_.push_back({std::max(last_, now + milliseconds{way_.delay_ms}), {}});
  }
}

/// As a hub of a later version would write it.
void Flow::spoil(std::span<std::byte> frame) {
  if (frame.size() < proto::kHeaderSize) return;
  proto::FrameHeader header = proto::load_header(frame.data());
  if (header.kind != proto::Kind::unicast) return;
  header.flags |= proto::kFlagReservedMask;
  proto::store_header(frame.data(), header);
  spoils_ = false;
}

void Flow::look(const Tap& tap) {
  if (frames_.size() < skip_) return;
  std::size_t next = std::exchange(skip_, 0);
  while (frames_.size() - next >= proto::kHeaderSize) {
    const proto::FrameHeader header = proto::load_header(frames_.data() + next);
    if (frames_.size() - next < header.frame_size()) break;
    tap(header, std::span(frames_).subspan(next + proto::kHeaderSize, header.length));
    next += header.frame_size();
  }
  frames_.erase(frames_.begin(), frames_.begin() + static_cast<std::ptrdiff_t>(next));
}

std::optional<std::vector<std::byte>> Flow::arrive(milliseconds now) {
  if (under_way_.empty() || under_way_.front().at > now) return std::nullopt;
  std::vector<std::byte> bytes = std::move(under_way_.front().bytes);
  under_way_.pop_front();
  bytes_ -= bytes.size();
  ended_ = ended_ || bytes.empty();
  return bytes;
}

Line::Line(std::size_t index, const WirePlan& way)
    : Line(index, way, hub::make_memory_pipe(), hub::make_memory_pipe()) {}

Line::Line(std::size_t index, const WirePlan& way, Pipe dialler, Pipe acceptor)
    : wire(index),
      stream(std::move(dialler.first)),
      other(std::move(acceptor.first)),
      peers{dialler.second, acceptor.second},
      flows{Flow(way, dialler.second, false), Flow(way, acceptor.second, true)} {}

}  // namespace gimnet::sim::hubs
