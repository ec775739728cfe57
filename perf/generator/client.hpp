#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "generator/messages.hpp"
#include "proto/frame/flow.hpp"

namespace gimnet::perf {

/// One connection of the generator to the subject that is measured. What is written is either a
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
  bool is_reading = true;    ///< a stalled client is not read
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

}  // namespace gimnet::perf
