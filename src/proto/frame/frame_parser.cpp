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

FrameError take_recipients(Rest& rest, std::uint32_t count, ListIds& recipients) {
  const std::size_t bytes = std::size_t{4} * count;
  if (!rest.has(bytes)) return FrameError::list_too_short;
  const ListIds ids(rest.take(bytes).data(), count);
  for (std::uint32_t i = 1; i < ids.size(); ++i) {
    if (ids[i] <= ids[i - 1]) return FrameError::list_not_ascending;
  }
  recipients = ids;
  return FrameError::none;
}

FrameError take_extensions(Rest& rest, std::span<const std::byte>& extensions) {
  if (!rest.has(kExtensionsPrefixSize)) return FrameError::ext_too_short;
  const auto bytes = load_le<std::uint16_t>(rest.take(kExtensionsPrefixSize).data());
  if (!rest.has(bytes)) return FrameError::ext_too_short;
  extensions = rest.take(bytes);
  return valid_extensions(extensions) ? FrameError::none : FrameError::ext_too_short;
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
  const FrameHeader header = load_header(frame.data());
  if (const auto error = check_header(header, origin); error != FrameError::none) return error;
  if (frame.size() < header.frame_size()) return FrameError::incomplete;
  const auto after_header = frame.subspan(kHeaderSize, header.length);
  Rest rest(after_header);
  // Put together at the end: a view that is filled in bit by bit is first set to zeros as a whole,
  // which took longer than all else here.
  ListIds recipients;
  std::span<const std::byte> extensions;
  std::optional<FragmentHeader> fragment;
  std::optional<std::uint64_t> key;
  if (header.kind == Kind::list) {
    const FrameError error = take_recipients(rest, header.dst, recipients);
    if (error != FrameError::none) return error;
  }
  if (header.has(kFlagExt)) {
    const FrameError error = take_extensions(rest, extensions);
    if (error != FrameError::none) return error;
  }
  if (header.has(kFlagFragment)) {
    if (!rest.has(kFragmentHeaderSize)) return FrameError::fragment_too_short;
    fragment = load_fragment_header(rest.take(kFragmentHeaderSize).data());
  }
  if (header.has(kFlagKeyed)) {
    if (!rest.has(kKeySize)) return FrameError::key_too_short;
    key = load_le<std::uint64_t>(rest.take(kKeySize).data());
  }
  if (fragment) {
    const FrameError error = check_fragment(*fragment, rest.all().size());
    if (error != FrameError::none) return error;
  }
  return Result<FrameView, FrameError>(std::in_place, header, recipients, extensions, fragment, key,
                                       rest.all(), after_header);
}

}  // namespace gimnet::proto
