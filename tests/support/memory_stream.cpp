#include "tests/support/memory_stream.hpp"

#include <algorithm>
#include <cstring>

#include "base/check.hpp"
#include "tests/net/support/toy_stream.hpp"

namespace gimnet::hub {
namespace {

/// A FIFO of bytes whose memory is kept, so that a warmed-up pipe does not allocate.
class ByteQueue {
 public:
  void append(const std::byte* bytes, std::size_t size) {
    if (begin_ == bytes_.size()) clear();
    bytes_.insert(bytes_.end(), bytes, bytes + size);
  }
  [[nodiscard]] std::size_t size() const { return bytes_.size() - begin_; }
  [[nodiscard]] std::span<const std::byte> bytes() const {
    return std::span(bytes_).subspan(begin_);
  }
  /// REQUIRES: size <= size().
  const std::byte* take(std::size_t size) {
    const std::byte* taken = bytes_.data() + begin_;
    begin_ += size;
    return taken;
  }
  void clear() {
    bytes_.clear();
    begin_ = 0;
  }

 private:
  std::vector<std::byte> bytes_;
  std::size_t begin_ = 0;
};

/// The bytes that each of the next calls may move.
class Plan {
 public:
  void set(std::vector<std::size_t> sizes) {
    sizes_ = std::move(sizes);
    next_ = 0;
  }
  [[nodiscard]] std::size_t next() {
    return next_ < sizes_.size() ? sizes_[next_++] : ~std::size_t{0};
  }

 private:
  std::vector<std::size_t> sizes_;
  std::size_t next_ = 0;
};

}  // namespace

struct MemoryPipe {
  ByteQueue to_hub;
  ByteQueue to_peer;
  Plan sends;
  Plan receives;
  std::size_t room = ~std::size_t{0};
  std::size_t reset_after = ~std::size_t{0};
  std::uint32_t unsent_limit = 0;
  std::uint32_t unacknowledged_limit = 0;
  std::uint64_t send_calls = 0;
  bool closed = false;
  bool failed = false;
  bool shut_down = false;
  bool gone = false;
  bool toy = false;
  net::ToyCode code;               ///< of the records to the peer
  std::vector<std::byte> decoded;  ///< for the peer, not read yet

  [[nodiscard]] std::size_t free_room() const { return room - std::min(room, to_peer.size()); }
};

MemoryStream::MemoryStream(std::shared_ptr<MemoryPipe> pipe) : pipe_(std::move(pipe)) {}

MemoryStream::~MemoryStream() { pipe_->gone = true; }

net::IoResult MemoryStream::receive(std::span<std::byte> into) {
  GIMNET_CHECK(!into.empty());
  MemoryPipe& pipe = *pipe_;
  if (pipe.failed) return {net::IoStatus::failed, 0};
  if (pipe.to_hub.size() == 0)
    return {pipe.closed ? net::IoStatus::closed : net::IoStatus::would_block, 0};
  const std::size_t size = std::min({into.size(), pipe.to_hub.size(), pipe.receives.next()});
  if (size == 0) return {net::IoStatus::would_block, 0};
  std::memcpy(into.data(), pipe.to_hub.take(size), size);
  return {net::IoStatus::ok, size};
}

net::IoResult MemoryStream::send(std::span<const iovec> pieces) {
  GIMNET_CHECK(pieces.size() <= net::kPiecesMax);
  MemoryPipe& pipe = *pipe_;
  ++pipe.send_calls;
  if (pipe.failed) return {net::IoStatus::failed, 0};
  if (pieces.empty()) return {net::IoStatus::ok, 0};
  std::size_t allowed = std::min({pipe.free_room(), pipe.sends.next(), pipe.reset_after});
  std::size_t sent = 0;
  for (const iovec& piece : pieces) {
    GIMNET_CHECK(piece.iov_len != 0);
    const std::size_t size = std::min(allowed - sent, piece.iov_len);
    pipe.to_peer.append(static_cast<const std::byte*>(piece.iov_base), size);
    sent += size;
    if (size < piece.iov_len) break;
  }
  if (pipe.reset_after != ~std::size_t{0}) {
    pipe.reset_after -= sent;
    pipe.failed = pipe.reset_after == 0;
    if (sent == 0 && pipe.failed) return {net::IoStatus::failed, 0};
  }
  return sent == 0 ? net::IoResult{net::IoStatus::would_block, 0}
                   : net::IoResult{net::IoStatus::ok, sent};
}

void MemoryStream::shut_down() { pipe_->shut_down = true; }

std::uint64_t MemoryStream::unsent_bytes() const { return pipe_->to_peer.size(); }

void MemoryStream::limit_unsent(std::uint32_t bytes) { pipe_->unsent_limit = bytes; }

void MemoryStream::limit_unacknowledged(std::uint32_t ms) { pipe_->unacknowledged_limit = ms; }

MemoryPeer::MemoryPeer(std::shared_ptr<MemoryPipe> pipe) : pipe_(std::move(pipe)) {}

void MemoryPeer::write(std::span<const std::byte> bytes) {
  if (!pipe_->toy) return pipe_->to_hub.append(bytes.data(), bytes.size());
  const auto own = net::ToyCode::own_record();
  pipe_->to_hub.append(own.data(), own.size());
  const std::vector<std::byte> records = net::ToyCode::encode(bytes);
  pipe_->to_hub.append(records.data(), records.size());
}

std::size_t MemoryPeer::read(std::vector<std::byte>& into, std::size_t most) {
  if (pipe_->toy) return read_records(into, most);
  const std::size_t size = std::min(most, pipe_->to_peer.size());
  const std::byte* bytes = pipe_->to_peer.take(size);
  into.insert(into.end(), bytes, bytes + size);
  return size;
}

std::size_t MemoryPeer::read_records(std::vector<std::byte>& into, std::size_t most) {
  std::vector<std::byte>& decoded = pipe_->decoded;
  while (decoded.size() < most && pipe_->to_peer.size() != 0) {
    const std::size_t size = std::min(net::ToyCode::kRecord, pipe_->to_peer.size());
    pipe_->code.decode({pipe_->to_peer.take(size), size}, decoded);
  }
  const std::size_t size = std::min(most, decoded.size());
  const auto end = decoded.begin() + static_cast<std::ptrdiff_t>(size);
  into.insert(into.end(), decoded.begin(), end);
  decoded.erase(decoded.begin(), end);
  return size;
}

std::size_t MemoryPeer::readable() const {
  if (!pipe_->toy) return pipe_->to_peer.size();
  net::ToyCode code = pipe_->code;
  std::vector<std::byte> decoded = pipe_->decoded;
  code.decode(pipe_->to_peer.bytes(), decoded);
  return decoded.size();
}

void MemoryPeer::close() { pipe_->closed = true; }

void MemoryPeer::reset() { pipe_->failed = true; }

void MemoryPeer::reset_after(std::size_t bytes) {
  pipe_->reset_after = bytes;
  pipe_->failed = bytes == 0;
}

void MemoryPeer::set_room(std::size_t bytes) { pipe_->room = bytes; }

void MemoryPeer::plan_sends(std::vector<std::size_t> bytes) { pipe_->sends.set(std::move(bytes)); }

void MemoryPeer::plan_receives(std::vector<std::size_t> bytes) {
  pipe_->receives.set(std::move(bytes));
}

bool MemoryPeer::transport_readable() const {
  return pipe_->failed || pipe_->closed || pipe_->to_hub.size() != 0;
}

bool MemoryPeer::transport_writable() const { return pipe_->failed || pipe_->free_room() != 0; }

bool MemoryPeer::shut_down() const { return pipe_->shut_down; }

bool MemoryPeer::transport_gone() const { return pipe_->gone; }

std::uint32_t MemoryPeer::unsent_limit() const { return pipe_->unsent_limit; }

std::uint32_t MemoryPeer::unacknowledged_limit() const { return pipe_->unacknowledged_limit; }

std::uint64_t MemoryPeer::send_calls() const { return pipe_->send_calls; }

std::pair<std::unique_ptr<net::Stream>, MemoryPeer> make_memory_pipe() {
  auto pipe = std::make_shared<MemoryPipe>();
  pipe->toy = net::toy_streams_wanted();
  std::unique_ptr<net::Stream> stream = std::make_unique<MemoryStream>(pipe);
  if (pipe->toy) stream = std::make_unique<net::ToyStream>(std::move(stream));
  return {std::move(stream), MemoryPeer(pipe)};
}

}  // namespace gimnet::hub
