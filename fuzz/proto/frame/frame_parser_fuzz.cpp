// Any bytes as a node's stream: the same frames however they are split, the same parts after taking
// a frame apart and building it again, and nothing accepted that section 2 of the protocol forbids.
// Input: frames, one after the other.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fuzz/support/fuzz_input.hpp"
#include "proto/frame/frame_builder.hpp"
#include "proto/frame/frame_parser.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::proto;
using Bytes = std::span<const std::byte>;

constexpr std::uint32_t kLengthMax = 4096;

/// The beginnings of frames, and the end of reading, by the plainest code there is.
struct Cut {
  std::vector<std::size_t> frames;
  std::size_t end = 0;
  bool too_long = false;
  friend bool operator==(const Cut&, const Cut&) = default;
};

Cut cut_naively(Bytes stream) {
  Cut cut;
  while (stream.size() - cut.end >= kHeaderSize) {
    const FrameHeader header = load_header(stream.data() + cut.end);
    cut.too_long = header.length > kLengthMax;
    if (cut.too_long || header.frame_size() > stream.size() - cut.end) break;
    cut.frames.push_back(cut.end);
    cut.end += header.frame_size();
  }
  return cut;
}

/// Takes the run apart into frames, which must agree in all but their length.
void add_run(Cut& cut, const RunView& run) {
  FUZZ_MUST(run.frames >= 1);
  const FrameHeader first = load_header(run.bytes);
  FUZZ_MUST(run.frames == 1 || may_form_run(first));
  std::size_t at = 0;
  for (std::uint32_t i = 0; i < run.frames; ++i) {
    FrameHeader header = load_header(run.bytes + at);
    cut.frames.push_back(cut.end + at);
    at += header.frame_size();
    header.length = first.length;
    FUZZ_MUST(header == first);
  }
  FUZZ_MUST(at == run.size);
  cut.end += run.size;
}

/// Reads the stream as it would arrive in pieces; each piece is read in memory that ends with it.
Cut cut_in_pieces(Bytes stream, std::size_t piece) {
  Cut cut;
  std::size_t arrived = 0;
  while (arrived < stream.size() && !cut.too_long) {
    arrived = std::min(stream.size(), arrived + piece);
    const fuzz::ExactCopy buffer(stream.subspan(cut.end, arrived - cut.end));
    const std::byte* begin = buffer.span().data();
    const std::byte* end = begin + buffer.span().size();
    for (;;) {
      const NextRun next = next_run(begin, end, kLengthMax);
      cut.too_long = next.found == Found::too_long;
      if (next.found == Found::need_more)
        FUZZ_MUST(next.needed > static_cast<std::size_t>(end - begin));
      if (next.found != Found::run) break;
      add_run(cut, next.run);
      begin += next.run.size;
    }
  }
  return cut;
}

void check_legal(const FrameView& frame) {
  FUZZ_MUST(frame.header.lane < kLaneCount && frame.header.hops == 0 &&
            (frame.header.flags & 0xC0) == 0);
  FUZZ_MUST(frame.header.kind != Kind::list || frame.recipients.size() == frame.header.dst);
  for (std::uint32_t i = 1; i < frame.recipients.size(); ++i) {
    FUZZ_MUST(frame.recipients[i - 1] < frame.recipients[i]);
  }
  if (!frame.fragment) return;
  FUZZ_MUST(!frame.payload.empty());
  FUZZ_MUST(std::uint64_t{frame.fragment->offset} + frame.payload.size() <= frame.fragment->total);
}

void check_rebuilt(const FrameView& frame) {
  std::vector<NodeId> ids;
  for (std::uint32_t i = 0; i < frame.recipients.size(); ++i) ids.push_back(frame.recipients[i]);
  FrameParts parts;
  parts.header = frame.header;
  parts.recipients = ids;
  parts.extensions = frame.extensions;
  parts.fragment = frame.fragment;
  parts.key = frame.key;
  std::vector<std::byte> bytes(frame.header.frame_size());
  bytes.resize(write_frame(parts, frame.payload, bytes));
  const auto again = parse_frame(bytes, Origin::hub);
  FUZZ_MUST(again.has_value());
  FUZZ_MUST(again->fragment == frame.fragment && again->key == frame.key);
  FUZZ_MUST(fuzz::same(again->payload, frame.payload) &&
            fuzz::same(again->extensions, frame.extensions));
  FUZZ_MUST(again->recipients.size() == frame.recipients.size());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const Bytes stream = fuzz::input(data, size);
  const Cut expected = cut_naively(stream);
  const std::size_t chosen = size == 0 ? 1 : 1 + data[size - 1];
  for (const std::size_t piece : {std::size_t{1}, std::size_t{17}, chosen, size + 1}) {
    if (piece == 1 && size > 512) continue;  // quadratic
    FUZZ_MUST(cut_in_pieces(stream, piece) == expected);
  }
  for (const std::size_t at : expected.frames) {
    const fuzz::ExactCopy bytes(stream.subspan(at, load_header(stream.data() + at).frame_size()));
    if (const auto frame = parse_frame(bytes.span(), Origin::node)) check_legal(*frame);
    if (const auto frame = parse_frame(bytes.span(), Origin::hub)) check_rebuilt(*frame);
  }
  return 0;
}
