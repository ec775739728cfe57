#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>

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
    bool is_bursty = false;  ///< many messages one after the other are sent: gathering them pays
  };

  LibraryClient() = default;
  LibraryClient(const LibraryClient&) = delete;
  LibraryClient& operator=(const LibraryClient&) = delete;
  virtual ~LibraryClient() = default;

  /// Connects. When it returns the partner's messages reach `on_message`, one at a time.
  virtual void open(const Setup& setup, OnMessage on_message) = 0;
  /// Sends to the partner. Thread safety: the main thread, and inside `on_message`.
  virtual void send(std::span<const std::byte> payload) = 0;

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

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool woken_ = false;
};

/// The one library that this program was linked with.
[[nodiscard]] std::unique_ptr<LibraryClient> make_library_client();

}  // namespace gimnet::perf
