#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "gimnet/gimi.h"
#include "tests/stress/support/playground.hpp"
#include "tests/stress/support/size.hpp"

namespace gimnet::stress {

/// One thread that calls functions of gimnet/gimi.h by chance, with handles that others use and
/// close meanwhile. It checks what holds of every call: it returns within its limit, a failure has
/// a sentence, and data arrive as they were sent. Thread safety: one thread.
class ApiCaller {
 public:
  ApiCaller(Playground& playground, std::uint64_t seed) : shared(playground), random(seed) {}
  ApiCaller(const ApiCaller&) = delete;
  ApiCaller& operator=(const ApiCaller&) = delete;
  ~ApiCaller() { release_all(); }

  void call_one();
  /// In a child after fork(): calls everything that takes a handle of the parent, which has to
  /// answer so, and ends its handles.
  void call_all_in_child();
  void release_all();
  /// The longest time that a call took beyond its limit, and which.
  [[nodiscard]] std::string worst() const;
  [[nodiscard]] std::uint64_t calls() const { return calls_; }

  // ---- for the calls

  [[nodiscard]] std::uint64_t below(std::uint64_t limit) { return random() % limit; }
  [[nodiscard]] bool one_in(std::uint64_t chances) { return below(chances) == 0; }
  template <class T>
  [[nodiscard]] T one_of(std::initializer_list<T> choices) {
    return choices.begin()[below(choices.size())];
  }
  /// Mostly an open handle of that kind.
  [[nodiscard]] gimi_handle handle(Kind kind);
  [[nodiscard]] std::int32_t timeout() { return one_of<std::int32_t>({0, 0, 1, 5, 20, 50}); }
  /// A time for the hub's answer.
  [[nodiscard]] std::int32_t patience() { return one_of<std::int32_t>({1, 200, 200, 500}); }
  [[nodiscard]] const char* node_name() {
    return one_of({"robot", "robot", "calc", "calc", "viewer", "a/b", "", "/"});
  }
  /// Bytes of which each says how many there are. Valid until: the next call of this.
  [[nodiscard]] gimi_bytes data();
  /// Calls, and checks the answer and the time.
  template <class Function>
  gimi_status timed(std::int32_t limit_ms, const Function& function) {
    begin();
    return judge(limit_ms, function());
  }
  /// The same of a call that answers a number, 0 where there is no such handle.
  template <class Function>
  std::uint64_t number(const Function& function) {
    begin();
    const std::uint64_t answer = function();
    judge_number(answer);
    return answer;
  }
  /// A handle that was made, if it was. It is read then: the call stands in the first argument.
  void keep(gimi_status status, const gimi_handle& made);
  void close(gimi_handle handle);
  /// Looks at a message, and keeps it for a while.
  void take(gimi_message& message);
  void look_at(const gimi_message& message) const;
  /// Answers a request, or keeps it for a while, or lets it go.
  void take(gimi_request& request);
  void finish(gimi_request& request);
  [[nodiscard]] bool is_child() const { return is_child_; }

  Playground& shared;
  std::mt19937_64 random;

 private:
  void begin() { begun_ = Clock::now(); }
  gimi_status judge(std::int32_t limit_ms, gimi_status status);
  void judge_number(std::uint64_t answer);
  void judge_time(std::int32_t limit_ms);
  void note_success();

  std::vector<gimi_message> messages_;
  std::vector<gimi_request> requests_;
  std::vector<std::uint8_t> data_;
  const char* name_ = "";   ///< of the call
  gimi_handle picked_ = 0;  ///< last
  Clock::time_point begun_;
  std::uint64_t calls_ = 0;
  std::set<std::string> noted_;  ///< successes that were told to the others
  std::int64_t worst_ms_ = INT64_MIN;
  std::string worst_;
  bool is_child_ = false;
};

/// A function of the API, with arguments by chance.
struct ApiCall {
  const char* name;
  void (*call)(ApiCaller& caller);
  unsigned weight = 4;
  bool takes_handle = true;  ///< of a node, or what belongs to one
};

[[nodiscard]] std::span<const ApiCall> node_calls();
[[nodiscard]] std::span<const ApiCall> hub_calls();
[[nodiscard]] std::span<const ApiCall> service_calls();
[[nodiscard]] std::span<const ApiCall> receive_calls();
[[nodiscard]] std::span<const ApiCall> request_calls();
[[nodiscard]] std::span<const ApiCall> session_calls();

}  // namespace gimnet::stress
