#include "tests/sim/hubs/pictures.hpp"

#include <algorithm>

#include "base/endian.hpp"
#include "proto/frame/fragment_header.hpp"
#include "proto/frame/fragmenter.hpp"

namespace gimnet::sim::hubs {

using std::chrono::milliseconds;

std::vector<std::vector<std::byte>> Pictures::cut(std::uint32_t bytes, milliseconds now) {
  std::vector<std::byte> picture(bytes);
  store_le(picture.data(), static_cast<std::uint64_t>(now.count()));
  ++last_;
  std::vector<std::vector<std::byte>> frames;
  for (std::uint32_t offset = 0; offset < bytes; offset += proto::kFragmentPayload) {
    const std::uint32_t size = std::min(proto::kFragmentPayload, bytes - offset);
    std::vector<std::byte>& frame = frames.emplace_back(proto::kFragmentHeaderSize);
    proto::store_fragment_header(frame.data(), {last_, offset, bytes});
    const auto begin = picture.begin() + static_cast<std::ptrdiff_t>(offset);
    frame.insert(frame.end(), begin, begin + static_cast<std::ptrdiff_t>(size));
  }
  return frames;
}

void Pictures::take(std::span<const std::byte> payload, milliseconds now) {
  const auto fragment = proto::load_fragment_header(payload.data());
  if (fragment.offset == 0) {
    picture_.clear();
    begun_ = fragment.message;
  }
  // A picture of which a part is missing never becomes whole.
  if (fragment.message != begun_ || fragment.offset != picture_.size()) return;
  const auto part = payload.subspan(proto::kFragmentHeaderSize);
  picture_.insert(picture_.end(), part.begin(), part.end());
  if (picture_.size() != fragment.total) return;
  seen_.push_back({milliseconds{load_le<std::uint64_t>(picture_.data())}, now});
}

}  // namespace gimnet::sim::hubs
