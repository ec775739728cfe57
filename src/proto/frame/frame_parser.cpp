#include "proto/frame/frame_parser.hpp"

#include <cstring>

#include "proto/frame/extensions.hpp"

namespace gimnet::proto {
namespace {

using HeaderWords [[gnu::vector_size(kHeaderSize)]] = std::uint64_t;

HeaderWords load_words(const std::byte* header) {
  HeaderWords words;
  std::memcpy(&words, header, sizeof words);
  return words;
}

/// The part of a frame that has not been taken apart yet.
class Rest {
 public:
  explicit Rest(std::span<const std::byte> bytes) : bytes_(bytes) {}
  [[nodiscard]] bool has(std::size_t size) const { return bytes_.size() >= size; }
  /// REQUIRES: has(size).
  std::span<const std::byte> take(std::size_t size) {
    GIMNET_ASSERT(has(size));
    const auto taken = bytes_.first(size);
    bytes_ = bytes_.subspan(size);
    return taken;
  }
  [[nodiscard]] std::span<const std::byte> all() const { return bytes_; }

 private:
  std::span<const std::byte> bytes_;
};

FrameError take_recipients(Rest& rest, FrameView& view) {
  const std::size_t bytes = std::size_t{4} * view.header.dst;
  if (!rest.has(bytes)) return FrameError::list_too_short;
  const ListIds ids(rest.take(bytes).data(), view.header.dst);
  for (std::uint32_t i = 1; i < ids.size(); ++i) {
    if (ids[i] <= ids[i - 1]) return FrameError::list_not_ascending;
  }
  view.recipients = ids;
  return FrameError::none;
}

FrameError take_extensions(Rest& rest, FrameView& view) {
  if (!rest.has(kExtensionsPrefixSize)) return FrameError::ext_too_short;
  const auto bytes = load_le<std::uint16_t>(rest.take(kExtensionsPrefixSize).data());
  if (!rest.has(bytes)) return FrameError::ext_too_short;
  view.extensions = rest.take(bytes);
  return valid_extensions(view.extensions) ? FrameError::none : FrameError::ext_too_short;
}

FrameError take_fragment_and_key(Rest& rest, FrameView& view) {
  if (view.header.has(kFlagFragment)) {
    if (!rest.has(kFragmentHeaderSize)) return FrameError::fragment_too_short;
    view.fragment = load_fragment_header(rest.take(kFragmentHeaderSize).data());
  }
  if (view.header.has(kFlagKeyed)) {
    if (!rest.has(kKeySize)) return FrameError::key_too_short;
    view.key = load_le<std::uint64_t>(rest.take(kKeySize).data());
  }
  return FrameError::none;
}

FrameError check_fragment(const FragmentHeader& fragment, std::size_t payload_size) {
  if (payload_size == 0) return FrameError::fragment_empty;
  const std::uint64_t end = std::uint64_t{fragment.offset} + payload_size;
  return end > fragment.total ? FrameError::fragment_over_total : FrameError::none;
}

FrameError check_header(const FrameHeader& header, Origin origin) {
  if (origin == Origin::node) return check_header_from_node(header);
  if ((header.lane & ~kLaneMask) != 0) return FrameError::reserved_lane_bits;
  if (static_cast<std::uint8_t>(header.kind) > static_cast<std::uint8_t>(Kind::route))
    return FrameError::unknown_kind;
  if (header.kind == Kind::list && header.dst > kListRecipientsMax) return FrameError::list_count;
  return FrameError::none;
}

FrameError take_apart(Rest& rest, FrameView& view) {
  if (view.header.kind == Kind::list) {
    if (const auto error = take_recipients(rest, view); error != FrameError::none) return error;
  }
  if (view.header.has(kFlagExt)) {
    if (const auto error = take_extensions(rest, view); error != FrameError::none) return error;
  }
  if (const auto error = take_fragment_and_key(rest, view); error != FrameError::none) return error;
  view.payload = rest.all();
  return view.fragment ? check_fragment(*view.fragment, view.payload.size()) : FrameError::none;
}

}  // namespace

/// Four at a time without a branch between: half the instructions of a frame.
std::uint32_t count_equal_fours(const std::byte* next, std::size_t available,
                                std::size_t frame_size, const std::byte* like) {
  const HeaderWords wanted = load_words(like);
  std::uint32_t count = 0;
  for (const std::size_t fours = 4 * frame_size; available >= fours;
       available -= fours, next += fours, count += 4) {
    const HeaderWords differ =
        (load_words(next) ^ wanted) | (load_words(next + frame_size) ^ wanted) |
        (load_words(next + 2 * frame_size) ^ wanted) | (load_words(next + 3 * frame_size) ^ wanted);
    if ((differ[0] | differ[1]) != 0) break;
  }
  return count;
}

Result<FrameView, FrameError> parse_frame(std::span<const std::byte> frame, Origin origin) {
  if (frame.size() < kHeaderSize) return FrameError::incomplete;
  FrameView view;
  view.header = load_header(frame.data());
  if (const auto error = check_header(view.header, origin); error != FrameError::none) return error;
  if (frame.size() < view.header.frame_size()) return FrameError::incomplete;
  view.after_header = frame.subspan(kHeaderSize, view.header.length);
  Rest rest(view.after_header);
  if (const auto error = take_apart(rest, view); error != FrameError::none) return error;
  return view;
}

}  // namespace gimnet::proto
