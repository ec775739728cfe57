#include "net/accept_handshake.hpp"

#include <algorithm>
#include <array>

#include "base/check.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::net {
namespace {

using proto::GoodbyeCode;

constexpr std::size_t kLengthBytes = 4;

/// A HELLO frame's header after its length: dst, src, kind, flags, hops. The lane is the
/// dialer's to choose.
constexpr std::array<std::byte, 11> kAfterLength{
    std::byte{}, std::byte{}, std::byte{},   std::byte{}, std::byte{}, std::byte{},
    std::byte{}, std::byte{}, std::byte{16}, std::byte{}, std::byte{}};
static_assert(static_cast<std::uint8_t>(kAfterLength[8]) ==
              static_cast<std::uint8_t>(proto::Kind::link));

}  // namespace

AcceptHandshake::AcceptHandshake(std::size_t bytes_max)
    : capacity_(bytes_max), buffer_(std::make_unique<std::byte[]>(capacity_)) {}

std::span<std::byte> AcceptHandshake::room() { return {buffer_.get() + size_, capacity_ - size_}; }

AcceptHandshake::Verdict AcceptHandshake::took(std::size_t bytes) {
  GIMNET_CHECK(bytes <= capacity_ - size_);
  size_ += bytes;
  const std::span<const std::byte> all{buffer_.get(), size_};
  switch (proto::check_opening(all)) {
    case proto::Opening::need_more:
      return Verdict::more;
    case proto::Opening::other_protocol:
      return Verdict::garbage;
    case proto::Opening::bad_version:
      return refuse(GoodbyeCode::bad_version,
                    "this hub speaks version " + std::to_string(proto::kVersionMajor) +
                        " of the protocol and you " +
                        std::to_string(static_cast<int>(all[proto::kOpeningSize - 2])) +
                        "; use a matching library");
    case proto::Opening::accepted:
      break;
  }
  const std::span<const std::byte> frame = all.subspan(proto::kOpeningSize);
  if (const Verdict verdict = check_header(frame); verdict != Verdict::hello) return verdict;
  const std::uint32_t length = proto::load_header(frame.data()).length;
  const std::span<const std::byte> rest = frame.subspan(proto::kHeaderSize);
  if (rest.size() < length) return Verdict::more;
  if (rest.size() > length) {
    return refuse(GoodbyeCode::malformed,
                  "there are bytes after HELLO; send nothing more before WELCOME");
  }
  return read_hello(rest);
}

AcceptHandshake::Verdict AcceptHandshake::check_header(std::span<const std::byte> frame) {
  const std::size_t size = std::min(frame.size(), proto::kHeaderSize);
  if (size >= kLengthBytes) {
    std::uint32_t length = 0;
    std::copy_n(frame.data(), kLengthBytes, reinterpret_cast<std::byte*>(&length));
    const std::size_t most = capacity_ - proto::kOpeningSize - proto::kHeaderSize;
    if (length > most) {
      return refuse(GoodbyeCode::malformed, "a HELLO of " + std::to_string(length) +
                                                " bytes after its header; " + std::to_string(most) +
                                                " are allowed");
    }
    const std::span<const std::byte> after = frame.subspan(kLengthBytes, size - kLengthBytes);
    const std::size_t known = std::min(after.size(), kAfterLength.size());
    if (!std::equal(after.begin(), after.begin() + static_cast<std::ptrdiff_t>(known),
                    kAfterLength.begin())) {
      return refuse(GoodbyeCode::malformed,
                    "the first frame is not a HELLO: kind 16, dst, src, flags and hops 0");
    }
  }
  if (size < proto::kHeaderSize) return Verdict::more;
  if ((proto::load_header(frame.data()).lane & ~proto::kLaneMask) != 0) {
    return refuse(GoodbyeCode::malformed, "reserved bits are set in the lane of HELLO");
  }
  return Verdict::hello;
}

AcceptHandshake::Verdict AcceptHandshake::read_hello(std::span<const std::byte> payload) {
  Result<proto::Hello> hello = proto::decode<proto::Hello>(payload);
  if (!hello) return refuse(GoodbyeCode::malformed, hello.error().sentence);
  hello_ = std::move(*hello);
  return Verdict::hello;
}

AcceptHandshake::Verdict AcceptHandshake::refuse(GoodbyeCode code, std::string sentence) {
  refusal_ = proto::Goodbye{code, std::move(sentence)};
  return Verdict::refused;
}

}  // namespace gimnet::net
