#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "gimnet/gimi.h"

// Shared by the threads of whole_api_test: handles, any of which any thread may use or close, and a
// book of the requests.

namespace gimnet::stress {

/// The kinds of handles, by the number that a handle has in it.
enum class Kind : std::uint8_t {
  node = 1,
  publisher,
  subscription,
  queue,
  sender,
  watch,
  pending,
  answers,
  wait_set,
  connection,
  accepted,
};
inline constexpr std::size_t kKinds = 11;

[[nodiscard]] inline Kind kind_of(gimi_handle handle) {
  return static_cast<Kind>((static_cast<std::uint32_t>(handle) >> 24) & 0xFF);
}

/// Open handles, and some that were closed. Thread safety: any thread.
class HandlePool {
 public:
  /// Keeps a handle. Returns another one that has to go for it, or 0.
  [[nodiscard]] gimi_handle put(gimi_handle handle, std::mt19937_64& random);
  /// One of that kind; 0: there is none.
  [[nodiscard]] gimi_handle pick(Kind kind, std::mt19937_64& random);
  /// The same, which nobody picks any more but pick_closed().
  [[nodiscard]] gimi_handle take(Kind kind, std::mt19937_64& random);
  /// Nobody picks that one any more. False: it is not here.
  [[nodiscard]] bool drop(gimi_handle handle);
  [[nodiscard]] gimi_handle pick_closed(std::mt19937_64& random);
  /// All of one kind, which are forgotten.
  [[nodiscard]] std::vector<gimi_handle> take_all(Kind kind);
  /// For a fork(): the child may not find it locked.
  void lock() { mutex_.lock(); }
  void unlock() { mutex_.unlock(); }

 private:
  [[nodiscard]] std::vector<gimi_handle>& of(Kind kind) {
    return open_.at(static_cast<std::size_t>(kind) - 1);
  }
  [[nodiscard]] gimi_handle remove(Kind kind, std::mt19937_64& random);

  std::mutex mutex_;
  std::array<std::vector<gimi_handle>, kKinds> open_;
  std::array<gimi_handle, 64> closed_{};
  std::size_t closed_count_ = 0;
};

/// Tells what became of the requests. Each has a number, with which its data begin. Thread safety:
/// any thread.
class RequestBook {
 public:
  [[nodiscard]] std::uint64_t begin(bool repeat);
  /// It was asked by gimi_ask_later().
  void is_pending(gimi_handle pending, std::uint64_t number);
  /// A program took it.
  void taken(std::uint64_t number);
  /// An end was told, or why it was not sent.
  void ended(std::uint64_t number, gimi_status status, gimi_ran ran);
  /// The same of a pending one, of which the ends beside GIMI_CLOSED are counted: there is one at
  /// most. Returns its number.
  std::uint64_t ended_later(gimi_handle pending, gimi_status status, gimi_ran ran);
  /// A handle is about to be closed: if a request belongs to it, that need not tell its end.
  void closed(gimi_handle handle);
  /// Compares what was told with what was done: each request ended once, but for those of which the
  /// handle or the node was closed. Returns how many there were of each end, in words.
  [[nodiscard]] std::string check();
  /// A reply came.
  [[nodiscard]] bool has_done() {
    const std::lock_guard lock(mutex_);
    return counts_.contains({GIMI_OK, GIMI_RAN_YES});
  }
  void lock() { mutex_.lock(); }
  void unlock() { mutex_.unlock(); }

 private:
  struct Entry {
    bool repeat = false;
    std::uint32_t taken = 0;
    std::uint32_t ends = 0;
    bool closed = false;   ///< its handle, or its node
    bool said_no = false;  ///< that nobody did it
    std::string words;     ///< with that
    bool said_yes = false;
  };
  void note(std::uint64_t number, gimi_status status, gimi_ran ran);

  std::mutex mutex_;
  std::vector<Entry> entries_;
  std::map<gimi_handle, std::uint64_t> pending_;
  std::map<std::pair<gimi_status, gimi_ran>, std::uint64_t> counts_;
};

/// Names of the calls that succeeded. Thread safety: any thread.
class SuccessBook {
 public:
  void succeeded(const char* call) {
    const std::lock_guard lock(mutex_);
    calls_.insert(call);
  }
  [[nodiscard]] std::set<std::string> calls() {
    const std::lock_guard lock(mutex_);
    return calls_;
  }

 private:
  std::mutex mutex_;
  std::set<std::string> calls_;
};

struct Playground {
  HandlePool handles;
  RequestBook requests;
  SuccessBook successes;
  std::vector<std::string> hubs;  ///< URLs, some of them by way of proxies
};

}  // namespace gimnet::stress
