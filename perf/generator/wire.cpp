#include "generator/wire.hpp"

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "net/socket.hpp"
#include "proto/frame/fragment_header.hpp"

namespace gimnet::perf {
namespace {

constexpr std::size_t kWholeBytesMax = 4 * 1024;
constexpr std::size_t kPieceBytes = 32 * 1024;
constexpr std::uint32_t kHub = 7u << kIndexBits;

void append_bytes(std::span<const std::byte> bytes, std::vector<std::byte>& to) {
  to.insert(to.end(), bytes.begin(), bytes.end());
}

void append_u32(std::uint32_t value, std::vector<std::byte>& to) {
  to.resize(to.size() + sizeof(value));
  store_le(to.data() + to.size() - sizeof(value), value);
}

}  // namespace

Client::~Client() { close(); }

void Client::close() {
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
}

bool Client::send_some(std::span<const std::byte>& bytes) {
  const ssize_t sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  if (sent < 0) {
    if (errno != EAGAIN && errno != EINTR) is_closed = true;
    return false;
  }
  bytes = bytes.subspan(static_cast<std::size_t>(sent));
  return bytes.empty();
}

bool Client::flush() {
  if (is_closed) return false;
  if (!begun_.empty() && !send_some(begun_)) return false;
  if (control_.empty()) return true;
  std::span<const std::byte> rest = std::span<const std::byte>(control_).subspan(control_sent_);
  const bool all = send_some(rest);
  control_sent_ = control_.size() - rest.size();
  if (!all) return false;
  control_.clear();
  control_sent_ = 0;
  return true;
}

bool Client::write(std::span<const std::byte> bytes) {
  begun_ = bytes;
  return send_some(begun_);
}

void Client::write_control(std::span<const std::byte> bytes) {
  control_.insert(control_.end(), bytes.begin(), bytes.end());
  flush();
}

std::uint32_t Wire::node_id(const Client& client) const {
  return kHub | static_cast<std::uint32_t>(client.index() + 1);
}

std::uint32_t Wire::group_id() const { return kHub | 1; }

void Wire::append_frame(const proto::FrameHeader& header, std::span<const std::byte> body,
                        std::vector<std::byte>& to) {
  proto::FrameHeader whole = header;
  whole.length = static_cast<std::uint32_t>(body.size());
  to.resize(to.size() + proto::kHeaderSize);
  proto::store_header(to.data() + to.size() - proto::kHeaderSize, whole);
  append_bytes(body, to);
}

proto::FrameHeader Wire::make_header(const Client& from, const Target& target,
                                     std::uint8_t lane) const {
  proto::FrameHeader header;
  header.src = node_id(from);
  header.lane = lane;
  switch (target.kind) {
    case Target::Kind::unicast:
      header.kind = proto::Kind::unicast;
      header.dst = node_id(*target.recipients.front());
      break;
    case Target::Kind::group:
      header.kind = proto::Kind::group;
      header.dst = group_id();
      break;
    case Target::Kind::list:
      header.kind = proto::Kind::list;
      header.dst = static_cast<std::uint32_t>(target.recipients.size());
      break;
  }
  return header;
}

void Wire::append_message(const Client& from, const Target& target, std::uint8_t lane,
                          std::span<const std::byte> payload, MessageBlock& block) {
  proto::FrameHeader header = make_header(from, target, lane);
  std::vector<std::uint32_t> ids;
  if (target.kind == Target::Kind::list) {
    for (const Client* recipient : target.recipients) ids.push_back(node_id(*recipient));
    std::sort(ids.begin(), ids.end());
  }
  const bool is_whole = payload.size() <= kWholeBytesMax;
  const std::size_t piece_bytes = is_whole ? payload.size() : kPieceBytes;
  if (!is_whole) header.flags = proto::kFlagFragment;
  auto& bytes = block.bytes;
  for (std::size_t offset = 0; offset < payload.size(); offset += piece_bytes) {
    const auto piece = payload.subspan(offset, std::min(piece_bytes, payload.size() - offset));
    header.length = static_cast<std::uint32_t>(
        ids.size() * 4 + (is_whole ? 0 : proto::kFragmentHeaderSize) + piece.size());
    bytes.resize(bytes.size() + proto::kHeaderSize);
    proto::store_header(bytes.data() + bytes.size() - proto::kHeaderSize, header);
    for (const std::uint32_t id : ids) append_u32(id, bytes);
    const std::size_t fragment_at = bytes.size();
    if (!is_whole) {
      bytes.resize(fragment_at + proto::kFragmentHeaderSize);
      proto::store_fragment_header(bytes.data() + fragment_at,
                                   {.offset = static_cast<std::uint32_t>(offset),
                                    .total = static_cast<std::uint32_t>(payload.size())});
    }
    if (offset == 0) block.mark_stamp(bytes.size(), target.stream);
    if (!is_whole) block.mark_number(fragment_at);
    append_bytes(piece, bytes);
  }
  block.mark_end();
}

std::size_t Wire::take(Client& client, std::span<const std::byte> bytes) {
  std::size_t at = 0;
  while (bytes.size() - at >= proto::kHeaderSize) {
    const auto header = proto::load_header(bytes.data() + at);
    if (header.length > proto::kFrameLengthMax) fail("a frame with an impossible length arrived");
    if (bytes.size() - at < header.frame_size()) break;
    const auto body = bytes.subspan(at + proto::kHeaderSize, header.length);
    if (header.kind <= proto::Kind::broadcast) {
      take_data(client, header, body);
    } else {
      take_other(client, header, body);
    }
    at += header.frame_size();
  }
  return at;
}

void Wire::take_data(Client& client, const proto::FrameHeader& header,
                     std::span<const std::byte> body) {
  if (header.kind == proto::Kind::unicast && header.dst != node_id(client))
    return client.inbox.on_wrong();
  if (header.flags == 0) return client.inbox.on_message(body);
  if (header.flags != proto::kFlagFragment || body.size() <= proto::kFragmentHeaderSize)
    return client.inbox.on_wrong();
  const auto fragment = proto::load_fragment_header(body.data());
  client.inbox.on_piece(fragment.message, fragment.offset, fragment.total,
                        body.subspan(proto::kFragmentHeaderSize));
}

void Wire::take_other(Client&, const proto::FrameHeader&, std::span<const std::byte>) {
  fail("the null relay sent a frame that nobody gave it");
}

}  // namespace gimnet::perf
