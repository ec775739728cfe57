#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <future>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "base/signals_blocked.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi/records.hpp"

namespace gimnet::tool {

/// For the answer of one of many hubs.
inline constexpr Timeout kMemberPatience{5000};
/// Hubs that are asked at the same time.
inline constexpr std::size_t kAskersMax = 16;
/// No further hub is asked then: very many may be silent.
inline constexpr std::int64_t kAskUntilNs = 10'000'000'000;

/// Of a hub that cannot be asked: why; else "".
[[nodiscard]] std::string why_not_asked(const NetworkHub& hub);

/// Asks many hubs: `ask(hub)`, an Answer with a member `error`, from several threads at a time. A
/// hub that cannot be asked, or whose turn does not come, has `error` alone. Answers are in the
/// order of the hubs. Silent hubs cost one patience in all where at most kAskersMax are, and never
/// more than kAskUntilNs and one patience.
template <class Answer, class Ask>
[[nodiscard]] std::vector<Answer> ask_each(const std::vector<NetworkHub>& hubs, Ask ask) {
  std::vector<Answer> answers(hubs.size());
  std::atomic<std::size_t> next{0};
  const std::int64_t until_ns = steady_now_ns() + kAskUntilNs;
  const auto work = [&] {
    // relaxed: each number is taken once, and the futures hand over what was written.
    for (std::size_t i = 0; (i = next.fetch_add(1, std::memory_order_relaxed)) < answers.size();) {
      answers[i].error = why_not_asked(hubs[i]);
      if (answers[i].error.empty() && steady_now_ns() >= until_ns)
        answers[i].error = "not asked: too many are silent";
      if (answers[i].error.empty()) answers[i] = ask(hubs[i]);
    }
  };
  const SignalsBlocked blocked;
  std::vector<std::future<void>> askers;
  for (std::size_t i = 0; i < std::min(kAskersMax, answers.size()); ++i)
    askers.push_back(std::async(std::launch::async, work));
  for (std::future<void>& asker : askers) asker.get();
  return answers;
}

}  // namespace gimnet::tool
