#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "generator/messages.hpp"
#include "proto/frame/flow.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::perf {

/// One connection of the generator to the subject that is measured. It writes either a
/// piece of a block of messages (referenced, valid until it is sent) or control bytes (copied),
/// never one inside the other.
class Client {
 public:
  Client(std::size_t index, int socket) : index_(index), socket_(socket) {}
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;
  ~Client();

  [[nodiscard]] std::size_t index() const { return index_; }
  [[nodiscard]] int socket() const { return socket_; }
  /// The bytes after the last message end; the next recv continues them.
  [[nodiscard]] std::vector<std::byte>& carry() { return carry_; }

  /// Closes the connection. Nothing may be sent or read after.
  void close();
  /// Sends what was begun. False: the kernel takes no more now, or the connection is broken.
  bool flush();
  /// Begins to write `bytes` with one system call. REQUIRES: flush() was true. Valid until: flush()
  /// is true.
  bool write(std::span<const std::byte> bytes);
  /// Sends a copy of `bytes` after what was begun.
  void write_control(std::span<const std::byte> bytes);

  Inbox inbox;
  bool is_joined = false;    ///< the subject has admitted it
  bool is_in_group = false;  ///< provides or subscribes, as asked
  bool is_closed = false;    ///< by the subject, or by close()
  /// PAUSEs that were not lifted yet (one RESUME lifts any number for its target): nothing is
  /// published meanwhile.
  std::vector<proto::flow::Target> paused;

 private:
  bool send_some(std::span<const std::byte>& bytes);

  const std::size_t index_;
  int socket_;
  std::vector<std::byte> carry_;
  std::span<const std::byte> begun_;
  std::vector<std::byte> control_;
  std::size_t control_sent_ = 0;
};

/// The recipients of a message.
struct Target {
  enum class Kind { unicast, group, list };
  Kind kind = Kind::unicast;
  std::vector<const Client*> recipients;  ///< one for unicast; unused for group
  StreamId stream = 0;
};

/// A subject's own account of what it carried, in frames and recipients. Where nothing moves,
/// accepted + copies = delivered + dropped + queued.
struct Ledger {
  std::uint64_t accepted = 0;
  std::uint64_t copies = 0;
  std::uint64_t delivered = 0;
  std::uint64_t dropped = 0;
  std::uint64_t queued = 0;
};

/// Words that only say that somebody is there.
struct KeepAlives {
  std::uint64_t said = 0;      ///< by the clients
  std::uint64_t answered = 0;  ///< of those, by the subject
  std::uint64_t asked = 0;     ///< by the subject of its own accord; each is answered
};

/// The language of a subject: scenarios know clients, targets and messages, a wire knows bytes.
/// Messages are frames of docs/protocol.md, section 2, byte for byte the same through the hub and
/// through the null relay. By itself this is the null relay's wire: no handshake,
/// ids given by the order of connecting. Virtual calls are per read buffer, never per message.
///
/// A payload over 4 KiB travels in fragments of 32 KiB: the fewest equal pieces of a 64 KiB message
/// that are legal, since a frame's length, at most 65,536, counts the fragment header too. Such a
/// message is below the first window (1 MiB), so that no TAKEN is needed.
class Wire {
 public:
  virtual ~Wire() = default;

  /// Sends what `client` has to say first. It is admitted (client.is_joined) once the subject has.
  virtual void open(Client& client) { admit(client); }
  /// Makes `client` the publisher of the one group of a run; take() sets client.is_in_group.
  virtual void provide(Client& client) { client.is_in_group = true; }
  /// Makes `client` a subscriber of that group. REQUIRES: the publisher is in the group.
  virtual void subscribe(Client& client) { client.is_in_group = true; }
  /// Appends one message of `from` with `payload` to `block`, in lane `lane`.
  void append_message(const Client& from, const Target& target, std::uint8_t lane,
                      std::span<const std::byte> payload, MessageBlock& block);
  /// Hands the messages in `bytes` to client.inbox and answers what asks for an answer. Returns the
  /// bytes done; the rest is an incomplete message.
  [[nodiscard]] virtual std::size_t take(Client& client, std::span<const std::byte> bytes);
  /// Called once a second for every client.
  virtual void keep_alive(Client&) {}

  /// Clients that were admitted so far.
  [[nodiscard]] std::size_t joined_count() const { return joined_count_; }
  /// All so far; none where clients of this protocol need not say anything.
  [[nodiscard]] const KeepAlives& keep_alives() const { return keep_alives_; }
  /// Asks for the ledger; false: this subject keeps none. take() sets ledger().
  virtual bool ask_for_ledger(Client&) { return false; }
  [[nodiscard]] const std::optional<Ledger>& ledger() const { return ledger_; }

 protected:
  /// Marks `client` as joined; once.
  void admit(Client& client) {
    if (!client.is_joined) ++joined_count_;
    client.is_joined = true;
  }
  [[nodiscard]] virtual std::uint32_t node_id(const Client& client) const;
  [[nodiscard]] virtual std::uint32_t group_id() const;
  /// A frame that is not a message for the application.
  virtual void take_other(Client& client, const proto::FrameHeader& header,
                          std::span<const std::byte> body);
  /// Appends a frame.
  static void append_frame(const proto::FrameHeader& header, std::span<const std::byte> body,
                           std::vector<std::byte>& to);

  std::optional<Ledger> ledger_;
  KeepAlives keep_alives_;

 private:
  void take_data(Client& client, const proto::FrameHeader& header, std::span<const std::byte> body);
  [[nodiscard]] proto::FrameHeader make_header(const Client& from, const Target& target,
                                               std::uint8_t lane) const;

  std::size_t joined_count_ = 0;
};

}  // namespace gimnet::perf
