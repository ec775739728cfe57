#include "tests/client/nif/support/fake_hub.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <thread>

#include "base/endian.hpp"
#include "proto/frame/frame_builder.hpp"

namespace gimnet::nif::test {
namespace {

bool wait_readable(int descriptor) {
  pollfd wait{descriptor, POLLIN, 0};
  return ::poll(&wait, 1, static_cast<int>(std::chrono::milliseconds(kPatience).count())) > 0;
}

}  // namespace

proto::FrameView Frame::view() const {
  auto parsed = proto::parse_frame(bytes, proto::Origin::node);
  if (parsed) return *parsed;
  ADD_FAILURE() << proto::frame_error_text(parsed.error());
  return {};
}

std::string Frame::payload() const {
  const auto parsed = view();
  return {reinterpret_cast<const char*>(parsed.payload.data()), parsed.payload.size()};
}

std::optional<proto::flow::Message> Frame::flow() const {
  return proto::flow::decode(view().payload);
}

FakeConnection::FakeConnection(FakeConnection&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      buffer_(std::move(other.buffer_)),
      code_(other.code_) {}

FakeConnection& FakeConnection::operator=(FakeConnection&& other) noexcept {
  close();
  descriptor_ = std::exchange(other.descriptor_, -1);
  buffer_ = std::move(other.buffer_);
  code_ = other.code_;
  return *this;
}

void FakeConnection::close() {
  if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
  buffer_.clear();
}

bool FakeConnection::fill(std::size_t bytes) {
  while (buffer_.size() < bytes) {
    if (!wait_readable(descriptor_)) return false;
    std::array<std::byte, 65536> memory;
    const ssize_t received = ::recv(descriptor_, memory.data(), memory.size(), 0);
    if (received <= 0) return false;
    const auto got = std::span(memory).first(static_cast<std::size_t>(received));
    if (net::toy_streams_wanted()) {
      code_.decode(got, buffer_);
    } else {
      buffer_.insert(buffer_.end(), got.begin(), got.end());
    }
  }
  return true;
}

std::optional<Frame> FakeConnection::next() {
  if (!fill(proto::kHeaderSize)) return std::nullopt;
  Frame frame;
  frame.header = proto::load_header(buffer_.data());
  const std::size_t size = frame.header.frame_size();
  if (!fill(size)) return std::nullopt;
  const auto end = buffer_.begin() + static_cast<std::ptrdiff_t>(size);
  frame.bytes.assign(buffer_.begin(), end);
  buffer_.erase(buffer_.begin(), end);
  return frame;
}

std::optional<Frame> FakeConnection::next_message() {
  while (auto frame = next()) {
    if (frame->header.kind != proto::Kind::flow) return frame;
    const auto message = frame->flow();
    if (!message || !std::holds_alternative<proto::flow::Ping>(*message)) continue;
    const auto& ping = std::get<proto::flow::Ping>(*message);
    send(proto::flow::Pong{ping.sequence, ping.sent_ns, ping.sent_ns});
  }
  return std::nullopt;
}

std::optional<proto::Hello> FakeConnection::read_hello() {
  if (!fill(proto::kOpeningSize)) return std::nullopt;
  if (proto::check_opening(buffer_) != proto::Opening::accepted) return std::nullopt;
  buffer_.erase(buffer_.begin(), buffer_.begin() + proto::kOpeningSize);
  const auto frame = next();
  if (!frame || frame->header.kind != proto::Kind::link) return std::nullopt;
  auto hello = proto::decode<proto::Hello>(frame->view().payload);
  if (!hello) return std::nullopt;
  return std::move(*hello);
}

void FakeConnection::welcome(const proto::Welcome& welcome) {
  send(proto::kOpening);
  proto::FrameParts parts;
  parts.header.kind = proto::Kind::link;
  parts.header.dst = welcome.node.value();
  parts.header.src = kHubNode;
  const auto payload = proto::encode(welcome);
  send(parts, {reinterpret_cast<const char*>(payload.data()), payload.size()});
}

void FakeConnection::goodbye(proto::GoodbyeCode code, const std::string& sentence) {
  send_control(proto::Kind::link, proto::encode(proto::Goodbye{code, sentence}));
}

void FakeConnection::send(std::span<const std::byte> bytes) {
  if (!net::toy_streams_wanted()) return send_raw(bytes);
  send_raw(net::ToyCode::own_record());
  send_raw(net::ToyCode::encode(bytes));
}

void FakeConnection::send_raw(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(descriptor_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return;  // the node closed: what it then does is what the test looks at
    bytes = bytes.subspan(static_cast<std::size_t>(sent));
  }
}

void FakeConnection::send(const proto::FrameParts& parts, std::string_view payload) {
  std::vector<std::byte> frame(proto::prefix_size(parts) + payload.size());
  static_cast<void>(proto::write_frame(parts, std::as_bytes(std::span(payload)), frame));
  send(frame);
}

void FakeConnection::send(const proto::flow::Message& message) {
  std::array<std::byte, proto::flow::kFrameSizeMax> frame;
  send(std::span<const std::byte>(frame).first(
      proto::flow::encode_frame(message, NodeId{kHubNode}, frame)));
}

void FakeConnection::send_unicast(std::uint32_t from, std::uint32_t to, std::string_view payload) {
  proto::FrameParts parts;
  parts.header.src = from;
  parts.header.dst = to;
  send(parts, payload);
}

void FakeConnection::send_control(proto::Kind kind, const proto::Payload& payload) {
  proto::FrameParts parts;
  parts.header.kind = kind;
  parts.header.src = kHubNode;
  send(parts, {reinterpret_cast<const char*>(payload.data()), payload.size()});
}

bool FakeConnection::wait_closed() {
  while (next()) {
  }
  std::byte memory;
  return wait_readable(descriptor_) && ::recv(descriptor_, &memory, 1, 0) <= 0;
}

FakeHub::FakeHub() : descriptor_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  auto* const generic = reinterpret_cast<sockaddr*>(&address);
  EXPECT_EQ(::bind(descriptor_, generic, size), 0);
  EXPECT_EQ(::listen(descriptor_, 16), 0);
  EXPECT_EQ(::getsockname(descriptor_, generic, &size), 0);
  port_ = ntohs(address.sin_port);
}

FakeHub::~FakeHub() { ::close(descriptor_); }

std::string FakeHub::url() const { return "tcp://127.0.0.1:" + std::to_string(port_); }

FakeConnection FakeHub::accept() {
  EXPECT_TRUE(wait_readable(descriptor_)) << "nobody dialed";
  return FakeConnection(::accept4(descriptor_, nullptr, nullptr, SOCK_CLOEXEC));
}

FakeConnection FakeHub::admit(const proto::Welcome& welcome, proto::Hello* hello) {
  FakeConnection connection = accept();
  const auto read = connection.read_hello();
  EXPECT_TRUE(read.has_value());
  if (read && hello != nullptr) *hello = *read;
  connection.welcome(welcome);
  return connection;
}

proto::Welcome make_welcome(std::uint32_t resume_bytes) {
  proto::Welcome welcome;
  welcome.node = NodeId{kOwnId};
  welcome.token = std::vector<std::byte>(16, std::byte{0x5a});
  welcome.hub = HubId{7};
  welcome.hub_name = "hub";
  welcome.epoch = 0x1234;
  welcome.keep_alive_ms = 50;
  welcome.silent_ms = 60'000;
  welcome.resume_buffer_bytes = resume_bytes;
  welcome.grace_ms = 30'000;
  welcome.name = "robot";
  return welcome;
}

OpenNode& OpenNode::operator=(OpenNode&& other) noexcept {
  static_cast<void>(nif_close(node_));
  node_ = other.release();
  return *this;
}

nif_options default_options(const char* name) {
  nif_options options{};
  options.struct_size = sizeof options;
  options.name = name;
  options.connect_timeout_ms = 20'000;
  options.no_token_file = 1;  // tests of one name run side by side
  return options;
}

Connected connect_to(FakeHub& hub, nif_options options, const proto::Welcome& welcome) {
  Connected connected;
  const std::string url = hub.url();
  options.url = url.c_str();
  std::thread dialing([&connected, &options] {
    nif_node* node = nullptr;
    EXPECT_EQ(nif_connect(&options, &node), NIF_OK) << nif_error_text();
    connected.node = OpenNode(node);
  });
  connected.hub = hub.admit(welcome, &connected.hello);
  dialing.join();
  return connected;
}

nif_counters counters_of(nif_node* node) {
  nif_counters counters{};
  counters.struct_size = sizeof counters;
  EXPECT_EQ(nif_get_counters(node, &counters), NIF_OK);
  return counters;
}

nif_info info_of(nif_node* node) {
  nif_info info{};
  info.struct_size = sizeof info;
  EXPECT_EQ(nif_get_info(node, &info), NIF_OK);
  return info;
}

std::string pattern(std::size_t size, std::uint32_t seed) {
  std::string bytes(size, '\0');
  std::uint32_t state = seed * 2654435761u + 1;
  for (char& byte : bytes) {
    state = state * 1664525u + 1013904223u;
    byte = static_cast<char>(state >> 24);
  }
  return bytes;
}

}  // namespace gimnet::nif::test
