#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "generator/wire.hpp"
#include "net/socket.hpp"

namespace gimnet::perf {

using Clock = std::chrono::steady_clock;

/// All clients of a run, on one thread and one epoll: connects them, reads them, keeps them alive.
/// A subject that refuses, closes or does not answer ends the program with a sentence.
class Engine {
 public:
  Engine(Wire& wire, const std::string& url);
  ~Engine();
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  /// Connects `count` more clients, at most 64 of them waiting for their admission at a time.
  void connect(std::size_t count);
  /// Client 0 provides the group, clients 1..count subscribe to it.
  void join_group(std::size_t first_subscriber, std::size_t count);

  /// Waits at most `timeout` for something to read, then reads every ready client once. Returns the
  /// messages that were settled (delivered or known as lost) by that.
  std::uint64_t poll(std::chrono::nanoseconds timeout);
  /// Polls until `done` holds; false after `limit`.
  [[nodiscard]] bool poll_until(const std::function<bool()>& done, std::chrono::nanoseconds limit);

  /// Whether a client that the subject closes ends the program, which is the default.
  void tolerate_closing(bool tolerated) { is_closing_tolerated_ = tolerated; }
  void stop_reading(Client& client);
  /// Closes its connection, whatever is unread. REQUIRES: nothing is published by it any more.
  void close(Client& client);
  /// A message that stays away for longer is lost; 2 s unless set. More if nothing is timed, and a
  /// busy machine is no fault.
  void set_patience(std::chrono::nanoseconds patience) { patience_ = patience; }
  [[nodiscard]] std::chrono::nanoseconds patience() const { return patience_; }
  /// A subject that answers a request later than this is given up.
  [[nodiscard]] std::chrono::nanoseconds answer_limit() const { return 5 * patience_; }

  [[nodiscard]] Client& client(std::size_t index) { return *clients_[index]; }
  [[nodiscard]] std::size_t client_count() const { return clients_.size(); }
  [[nodiscard]] Wire& wire() { return wire_; }
  /// Of all clients together.
  struct Counts {
    std::uint64_t delivered = 0;
    std::uint64_t lost = 0;
    std::uint64_t wrong = 0;
  };
  [[nodiscard]] Counts counts() const;

 private:
  void watch(Client& client, int operation, std::uint32_t events) const;
  void keep_alive();
  void read(Client& client);
  void on_closed(Client& client);

  Wire& wire_;
  const gimnet::net::HostAddress address_;
  const int epoll_;
  std::unique_ptr<std::byte[]> buffer_;
  std::vector<std::unique_ptr<Client>> clients_;
  Clock::time_point next_keep_alive_;
  bool is_closing_tolerated_ = false;
  std::chrono::nanoseconds patience_ = std::chrono::seconds(2);
};

}  // namespace gimnet::perf
