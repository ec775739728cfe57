#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gimnet/nif.h"
#include "proto/control/control_message.hpp"
#include "proto/control/link.hpp"
#include "proto/frame/flow.hpp"
#include "proto/frame/frame_builder.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/net/support/toy_stream.hpp"

// A hub that says exactly what a test wants it to say, over a real socket on loopback.

namespace gimnet::nif::test {

inline constexpr std::chrono::seconds kPatience{20};

/// One frame as it came.
struct Frame {
  proto::FrameHeader header;
  std::vector<std::byte> bytes;  ///< header included
  [[nodiscard]] proto::FrameView view() const;
  [[nodiscard]] std::string payload() const;
  [[nodiscard]] std::optional<proto::flow::Message> flow() const;
};

/// The hub's end of one connection. Closes when it goes.
class FakeConnection {
 public:
  explicit FakeConnection(int descriptor) : descriptor_(descriptor) {}
  FakeConnection(FakeConnection&& other) noexcept;
  FakeConnection& operator=(FakeConnection&& other) noexcept;
  ~FakeConnection() { close(); }

  [[nodiscard]] bool open() const { return descriptor_ >= 0; }
  [[nodiscard]] int descriptor() const { return descriptor_; }
  void close();

  /// Reads opening and HELLO. Nothing: the peer closed, or kPatience is over.
  [[nodiscard]] std::optional<proto::Hello> read_hello();
  /// Sends the opening and WELCOME.
  void welcome(const proto::Welcome& welcome);
  void goodbye(proto::GoodbyeCode code, const std::string& sentence);

  /// The next frame of any kind. Nothing: the peer closed, or kPatience is over.
  [[nodiscard]] std::optional<Frame> next();
  /// The next frame that is not FLOW; PINGs are answered.
  [[nodiscard]] std::optional<Frame> next_message();
  /// The next FLOW frame of that kind; other FLOW frames are skipped.
  template <class Message>
  [[nodiscard]] std::optional<Message> next_flow() {
    while (auto frame = next()) {
      if (frame->header.kind != proto::Kind::flow) continue;
      const auto message = frame->flow();
      if (message && std::holds_alternative<Message>(*message)) return std::get<Message>(*message);
    }
    return std::nullopt;
  }
  /// The next request; its operation must be that of the message.
  template <class Message>
  [[nodiscard]] std::optional<Message> next_request(std::uint16_t& number) {
    const auto frame = next_message();
    if (!frame) return std::nullopt;
    const auto view = frame->view();
    auto message = proto::decode<Message>(view.payload);
    if (!message) return std::nullopt;
    number = proto::split_control(view.payload)->header.request;
    return std::move(*message);
  }

  void send(std::span<const std::byte> bytes);
  void send(const proto::FrameParts& parts, std::string_view payload);
  void send(const proto::flow::Message& message);
  void send_unicast(std::uint32_t from, std::uint32_t to, std::string_view payload);
  void send_control(proto::Kind kind, const proto::Payload& payload);

  /// Waits until the peer has closed. False: it did not within kPatience.
  [[nodiscard]] bool wait_closed();

 private:
  [[nodiscard]] bool fill(std::size_t bytes);
  void send_raw(std::span<const std::byte> bytes);
  int descriptor_ = -1;
  std::vector<std::byte> buffer_;
  net::ToyCode code_;  ///< where toy streams are wanted
};

/// A listener on loopback.
class FakeHub {
 public:
  FakeHub();
  ~FakeHub();
  FakeHub(const FakeHub&) = delete;
  FakeHub& operator=(const FakeHub&) = delete;

  [[nodiscard]] std::string url() const;
  /// The next connection. REQUIRES: one comes within kPatience.
  [[nodiscard]] FakeConnection accept();
  /// Accepts, reads HELLO and answers with WELCOME.
  [[nodiscard]] FakeConnection admit(const proto::Welcome& welcome, proto::Hello* hello = nullptr);

 private:
  int descriptor_ = -1;
  std::uint16_t port_ = 0;
};

inline constexpr std::uint32_t kHubNode = 7u << 20;
inline constexpr std::uint32_t kOwnId = (7u << 20) | 17;
inline constexpr std::uint32_t kPeerId = (7u << 20) | 18;

/// A WELCOME for kOwnId with short keep-alive times and, unless `resume_bytes` is 0, resume.
[[nodiscard]] proto::Welcome make_welcome(std::uint32_t resume_bytes = 0);

/// Handles are closed when this goes.
class OpenNode {
 public:
  OpenNode() = default;
  explicit OpenNode(nif_node* node) : node_(node) {}
  OpenNode(OpenNode&& other) noexcept : node_(other.release()) {}
  OpenNode& operator=(OpenNode&& other) noexcept;
  ~OpenNode() { static_cast<void>(nif_close(node_)); }
  [[nodiscard]] nif_node* get() const { return node_; }
  nif_node* release() { return std::exchange(node_, nullptr); }

 private:
  nif_node* node_ = nullptr;
};

/// A node and the hub's end of its connection.
struct Connected {
  OpenNode node;
  FakeConnection hub{-1};  ///< closed first, so that closing the node need not wait for it
  proto::Hello hello;
};

/// Connects a node to the hub; options.url is set here. A failure ends the test program's
/// expectations, not its life.
[[nodiscard]] Connected connect_to(FakeHub& hub, nif_options options,
                                   const proto::Welcome& welcome);
[[nodiscard]] nif_options default_options(const char* name = nullptr);

[[nodiscard]] nif_counters counters_of(nif_node* node);
[[nodiscard]] nif_info info_of(nif_node* node);

[[nodiscard]] inline std::string_view payload_of(const nif_incoming& in) {
  return {static_cast<const char*>(in.payload), in.size};
}
/// Bytes that differ from place to place, the same for the same seed.
[[nodiscard]] std::string pattern(std::size_t size, std::uint32_t seed = 1);

}  // namespace gimnet::nif::test
