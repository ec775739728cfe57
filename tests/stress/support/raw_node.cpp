#include "tests/stress/support/raw_node.hpp"

#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

namespace gimnet::stress {
namespace {

bool is_for_nodes(proto::Kind kind) {
  return kind < proto::Kind::link && kind != proto::Kind::report && kind != proto::Kind::flow;
}

}  // namespace

RawNode::RawNode(const std::string& url, const JoinOptions& options) {
  begin_join(url, options);
  const Deadline deadline;
  while (!finish_join()) {
    deadline.check("WELCOME");
    wait_readable({socket_.get()}, 100);
  }
}

void RawNode::begin_join(const std::string& url, const JoinOptions& options) {
  socket_ = dial(url, options.socket);
  put_bytes(proto::kOpening);
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::link;
  put(parts, proto::encode(options.hello));
  flush_all();
}

bool RawNode::finish_join() {
  read_some();
  if (is_closed_ && !goodbye_)
    throw std::runtime_error("the hub closed the connection before WELCOME");
  if (goodbye_) throw std::runtime_error("not admitted: " + goodbye_->sentence);
  if (buffer_.size() < proto::kOpeningSize) return false;
  if (taken_ == 0) taken_ = proto::kOpeningSize;
  while (!is_joined_) {
    const auto frame = next();
    if (goodbye_) throw std::runtime_error("not admitted: " + goodbye_->sentence);
    if (!frame) return false;
    auto welcome = proto::decode<proto::Welcome>(frame->body());
    if (!welcome) throw std::runtime_error(welcome.error().sentence);
    welcome_ = *welcome;
    is_joined_ = true;
  }
  return true;
}

bool RawNode::read_some(std::size_t bytes_max) {
  if (is_closed_) return false;
  if (taken_ == buffer_.size()) {
    buffer_.clear();
    taken_ = 0;
  } else if (taken_ > (1u << 16) || (is_joined_ && taken_ > buffer_.size() / 2)) {
    buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(taken_));
    taken_ = 0;
  }
  // Shared, and never cleared: mostly nothing or little comes, and a node keeps no more than that.
  static thread_local std::array<std::byte, kReadBytesMax> arrived;
  const ssize_t size =
      ::recv(socket_.get(), arrived.data(), std::min(bytes_max, arrived.size()), 0);
  const std::size_t came = size > 0 ? static_cast<std::size_t>(size) : 0;
  buffer_.insert(buffer_.end(), arrived.data(), arrived.data() + came);
  bytes_read_ += came;
  if (size == 0 || (size < 0 && errno != EAGAIN && errno != EINTR)) is_closed_ = true;
  return came > 0;
}

std::optional<Frame> RawNode::next() {
  for (;;) {
    const auto rest = std::span<const std::byte>(buffer_).subspan(taken_);
    if (rest.size() < proto::kHeaderSize) return std::nullopt;
    const proto::FrameHeader header = proto::load_header(rest.data());
    if (header.frame_size() > rest.size()) return std::nullopt;
    taken_ += header.frame_size();
    const Frame frame{header, rest.first(header.frame_size())};
    if (handle(frame)) continue;
    if (is_for_nodes(frame.header.kind)) ++frames_got_;
    return frame;
  }
}

Frame RawNode::wait_next(const Deadline& deadline) {
  for (;;) {
    if (const auto frame = next()) return *frame;
    if (is_closed_)
      throw std::runtime_error("closed: " +
                               (goodbye_ ? goodbye_->sentence : std::string("no word")));
    deadline.check("frame");
    if (!read_some()) wait_readable({socket_.get()}, 100);
  }
}

bool RawNode::handle(const Frame& frame) {
  if (frame.header.kind == proto::Kind::flow) {
    handle_flow(frame);
    return true;
  }
  if (frame.header.kind != proto::Kind::link) return false;
  const auto view = proto::split_control(frame.body());
  if (!view || view->header.operation != proto::Goodbye::kOperation) return false;
  const auto goodbye = proto::decode<proto::Goodbye>(frame.body());
  goodbye_ = goodbye ? *goodbye : proto::Goodbye{};
  return true;
}

void RawNode::handle_flow(const Frame& frame) {
  const auto message = proto::flow::decode(frame.body());
  if (!message) throw std::runtime_error("FLOW that cannot be read");
  if (const auto* ping = std::get_if<proto::flow::Ping>(&*message)) {
    put_flow(proto::flow::Pong{ping->sequence, ping->sent_ns, ping->sent_ns});
    flush();
  } else if (const auto* pause = std::get_if<proto::flow::Pause>(&*message)) {
    ++pauses_;
    const auto& target = pause->target;
    paused_[{target.kind, static_cast<std::uint8_t>(target.lane), target.dst}] = true;
  } else if (const auto* resume = std::get_if<proto::flow::Resume>(&*message)) {
    const auto& target = resume->target;
    paused_.erase({target.kind, static_cast<std::uint8_t>(target.lane), target.dst});
  }
}

void RawNode::put(proto::FrameParts parts, std::span<const std::byte> payload) {
  parts.header.src = welcome_.node.value();
  parts.payload_size = payload.size();
  const std::size_t before = out_.size();
  out_.resize(before + proto::prefix_size(parts) + payload.size());
  if (proto::write_frame(parts, payload, std::span(out_).subspan(before)) == 0)
    throw std::runtime_error("no frame");
  if (is_for_nodes(parts.header.kind)) ++frames_sent_;
}

void RawNode::put_flow(const proto::flow::Message& message) {
  std::array<std::byte, proto::flow::kFrameSizeMax> frame;
  const std::size_t size = proto::flow::encode_frame(message, welcome_.node, frame);
  put_bytes(std::span(frame).first(size));
}

void RawNode::put_bytes(std::span<const std::byte> bytes) {
  out_.insert(out_.end(), bytes.begin(), bytes.end());
}

bool RawNode::flush() {
  while (written_ < out_.size()) {
    const ssize_t size =
        ::send(socket_.get(), out_.data() + written_, out_.size() - written_, MSG_NOSIGNAL);
    if (size < 0 && errno != EINTR && errno != EAGAIN) {
      // The words of the hub before it closed can still be read; nothing more can be written.
      written_ = out_.size();
      break;
    }
    if (size < 0) return false;
    last_sent_ = Clock::now();
    written_ += static_cast<std::size_t>(size);
  }
  out_.clear();
  written_ = 0;
  return true;
}

void RawNode::flush_all(const Deadline& deadline) {
  while (!flush()) {
    deadline.check("room to write");
    // The peer may wait for this end to read; polled, not waited for.
    wait_readable({}, 1);
  }
}

bool RawNode::is_paused(proto::Kind kind, std::uint8_t lane, std::uint32_t dst) const {
  return paused_.contains({kind, lane, dst});
}

void RawNode::ping() {
  put_flow(proto::flow::Ping{++ping_sequence_, 0});
  flush();
}

void RawNode::keep_alive() {
  if (Clock::now() - last_sent_ >= std::chrono::milliseconds(500)) ping();
}

std::vector<std::byte> RawNode::exchange(proto::Kind kind, const proto::Payload& request) {
  put(parts_of(kind, 0), request);
  flush_all();
  const std::uint16_t number = proto::split_control(request)->header.request;
  for (;;) {
    const Frame frame = wait_next();
    if (frame.header.kind != kind) continue;
    const auto view = proto::split_control(frame.body());
    if (view && view->header.is_answer() && view->header.request == number) {
      return {frame.body().begin(), frame.body().end()};
    }
  }
}

void RawNode::leave() {
  put(parts_of(proto::Kind::link, 0),
      proto::encode(proto::Goodbye{proto::GoodbyeCode::done, "done"}));
  flush();
}

void RawNode::shut_down() { ::shutdown(socket_.get(), SHUT_WR); }

proto::FrameParts parts_of(proto::Kind kind, std::uint32_t dst, proto::Policy policy,
                           proto::Lane lane) {
  proto::FrameParts parts;
  parts.header.kind = kind;
  parts.header.dst = dst;
  parts.header.flags = static_cast<std::uint8_t>(policy);
  parts.header.lane = static_cast<std::uint8_t>(lane);
  return parts;
}

}  // namespace gimnet::stress
