#pragma once

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>

#include "net/socket.hpp"

namespace gimnet::perf {

/// One program on a messaging library that talks with a partner, a program of the same kind,
/// through a hub. Each library is used as its documentation would have it for messages that need
/// not be kept, and in its favour. Every failure ends the program with a sentence.
class LibraryClient {
 public:
  using Clock = std::chrono::steady_clock;
  using OnMessage = std::function<void(std::span<const std::byte>)>;

  struct Setup {
    std::string url;         ///< of the hub: tcp://HOST:PORT or unix:PATH
    std::string own;         ///< name under which this program is found
    std::string partner;     ///< name of the other one
    bool is_first = false;   ///< the partner starts later, and writes first
    bool is_burst = false;   ///< bursts go from the one to the other
    bool is_bursty = false;  ///< and this sends them: gathering them pays
  };

  LibraryClient() = default;
  LibraryClient(const LibraryClient&) = delete;
  LibraryClient& operator=(const LibraryClient&) = delete;
  virtual ~LibraryClient() = default;

  /// Connects. When it returns the partner's messages reach `on_message`, one at a time.
  virtual void open(const Setup& setup, OnMessage on_message) = 0;
  /// Sends to the partner. Thread safety: the main thread, and inside `on_message`.
  virtual void send(std::span<const std::byte> payload) = 0;

  /// In place of open(): sends requests and plain messages of the partner back to it, each on a
  /// thread of the library or one of its own. When it returns both reach it.
  virtual void answer(const Setup&) { fail(kNoRequests); }
  /// In place of open(): connects to a partner that answers.
  virtual void begin_asking(const Setup&) { fail(kNoRequests); }
  /// A request to the partner, and a plain message to it that it sends back. Both wait, and compare
  /// what comes with what went.
  virtual void ask(std::span<const std::byte>) { fail(kNoRequests); }
  virtual void send_round(std::span<const std::byte>) { fail(kNoRequests); }

  /// Lets messages come until wake() was called since the last wait(), or the time is up (false).
  /// The main thread.
  virtual bool wait(Clock::time_point deadline) {
    std::unique_lock lock(mutex_);
    const bool woken = changed_.wait_until(lock, deadline, [this] { return woken_; });
    woken_ = false;
    return woken;
  }
  /// Inside `on_message`.
  virtual void wake() {
    const std::lock_guard lock(mutex_);
    woken_ = true;
    changed_.notify_one();
  }

 protected:
  static bool is_same(std::span<const std::byte> sent, const void* data, std::size_t size) {
    const std::span got(static_cast<const std::byte*>(data), size);
    return std::ranges::equal(sent, got);
  }

 private:
  static constexpr const char* kNoRequests = "this library has no requests, or is not asked";

  std::mutex mutex_;
  std::condition_variable changed_;
  bool woken_ = false;
};

/// The one library that this program was linked with.
[[nodiscard]] std::unique_ptr<LibraryClient> make_library_client();

}  // namespace gimnet::perf
