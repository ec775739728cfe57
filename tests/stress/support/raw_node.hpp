#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "proto/control/control_message.hpp"
#include "proto/control/link.hpp"
#include "proto/frame/flow.hpp"
#include "proto/frame/frame_builder.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/stress/support/size.hpp"
#include "tests/stress/support/socket.hpp"

namespace gimnet::stress {

/// One call reads so much at most.
inline constexpr std::size_t kReadBytesMax = 256 * 1024;

/// One frame as the hub sent it. Valid until: the next read_some().
struct Frame {
  proto::FrameHeader header;
  std::span<const std::byte> bytes;  ///< header included
  [[nodiscard]] std::span<const std::byte> body() const {
    return bytes.subspan(proto::kHeaderSize);
  }
};

/// The terms of joining; the rest of HELLO as in `hello`.
struct JoinOptions {
  proto::Hello hello;
  SocketOptions socket;
};

/// A node made of the protocol library and a socket, which does exactly what a test wants and
/// counts what it does: it reads, writes and keeps alive only when told to. Failures throw. Thread
/// safety: one thread.
class RawNode {
 public:
  RawNode() = default;
  /// Joins and waits for WELCOME.
  RawNode(const std::string& url, const JoinOptions& options = {});

  /// The two halves of joining, for those who join many at once. finish_join() is false as long as
  /// nothing came.
  void begin_join(const std::string& url, const JoinOptions& options = {});
  [[nodiscard]] bool finish_join();

  [[nodiscard]] NodeId id() const { return welcome_.node; }
  [[nodiscard]] const proto::Welcome& welcome() const { return welcome_; }
  [[nodiscard]] int descriptor() const { return socket_.get(); }
  /// The hub ended the connection.
  [[nodiscard]] bool is_closed() const { return is_closed_; }
  /// The last word of the hub before it did.
  [[nodiscard]] const std::optional<proto::Goodbye>& goodbye() const { return goodbye_; }

  /// One recv(). True: something came.
  bool read_some(std::size_t bytes_max = kReadBytesMax);
  /// The next whole frame that was read. PINGs are answered, PAUSE and RESUME noted, GOODBYE kept,
  /// and not returned.
  [[nodiscard]] std::optional<Frame> next();
  /// Reads until there is a frame, or throws when the time is over or the connection ended.
  [[nodiscard]] Frame wait_next(const Deadline& deadline = Deadline());
  /// Bytes taken from the socket since the beginning.
  [[nodiscard]] std::uint64_t bytes_read() const { return bytes_read_; }
  /// Frames for nodes that put() was given, and frames of nodes that next() gave: what the hub's
  /// ledger counts.
  [[nodiscard]] std::uint64_t frames_sent() const { return frames_sent_; }
  [[nodiscard]] std::uint64_t frames_got() const { return frames_got_; }
  /// Position in bytes_read() of the end of the frame that next() gave last.
  [[nodiscard]] std::uint64_t position() const { return bytes_read_ - (buffer_.size() - taken_); }

  /// Puts a frame behind what waits to be written; src is filled in.
  void put(proto::FrameParts parts, std::span<const std::byte> payload);
  void put_flow(const proto::flow::Message& message);
  void put_bytes(std::span<const std::byte> bytes);
  /// Writes as much as the kernel takes. True: nothing waits any more.
  bool flush();
  void flush_all(const Deadline& deadline = Deadline());
  [[nodiscard]] std::size_t unwritten() const { return out_.size() - written_; }
  /// PAUSEd by the hub.
  [[nodiscard]] bool is_paused(proto::Kind kind, std::uint8_t lane, std::uint32_t dst) const;
  [[nodiscard]] std::size_t pauses() const { return pauses_; }
  void ping();
  /// Sends a PING where nothing was sent for half a second: to be called often by who wants to
  /// stay.
  void keep_alive();

  /// Asks the hub and waits for its answer, or why it says no; data frames that come before it are
  /// lost to the test.
  template <class Answer, class Request>
  [[nodiscard]] Result<Answer, proto::Refusal> try_ask(proto::Kind kind, const Request& request) {
    return proto::decode_answer<Answer>(exchange(kind, proto::encode(request, ++request_)));
  }
  /// The same where no is a failure.
  template <class Answer, class Request>
  [[nodiscard]] Answer ask(proto::Kind kind, const Request& request) {
    auto answer = try_ask<Answer>(kind, request);
    if (!answer) throw std::runtime_error(answer.error().sentence);
    return *answer;
  }

  /// Says GOODBYE `done`.
  void leave();
  /// No more bytes from here: the hub sees the end of the stream, and what it wrote can still be
  /// read.
  void shut_down();
  /// The connection alone, for who holds many and says nothing more on them.
  [[nodiscard]] Descriptor release() { return std::move(socket_); }
  /// Gone without a word.
  void close() { socket_.reset(); }

 private:
  using Target = std::tuple<proto::Kind, std::uint8_t, std::uint32_t>;
  [[nodiscard]] std::vector<std::byte> exchange(proto::Kind kind, const proto::Payload& request);
  [[nodiscard]] bool handle(const Frame& frame);
  void handle_flow(const Frame& frame);

  Descriptor socket_;
  proto::Welcome welcome_;
  std::optional<proto::Goodbye> goodbye_;
  bool is_joined_ = false;
  bool is_closed_ = false;
  std::vector<std::byte> buffer_;
  std::size_t taken_ = 0;
  std::uint64_t bytes_read_ = 0;
  std::uint64_t frames_sent_ = 0;
  std::uint64_t frames_got_ = 0;
  std::vector<std::byte> out_;
  std::size_t written_ = 0;
  std::map<Target, bool> paused_;
  std::size_t pauses_ = 0;
  std::uint32_t ping_sequence_ = 0;
  Clock::time_point last_sent_ = Clock::now();
  std::uint16_t request_ = 0;
};

/// The parts of a frame of `kind` to `dst` in `lane`.
[[nodiscard]] proto::FrameParts parts_of(proto::Kind kind, std::uint32_t dst,
                                         proto::Policy policy = proto::Policy::kind_default,
                                         proto::Lane lane = proto::Lane::normal);

}  // namespace gimnet::stress
