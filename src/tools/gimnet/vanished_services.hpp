#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "tools/gimnet/news_pace.hpp"

namespace gimnet::tool {

/// Services that came and went before anything of them came, and when to say so. Times are those of
/// steady_now_ns(). Thread safety: one thread.
class VanishedServices {
 public:
  /// How long a message may still come behind the news that its service is gone.
  static constexpr std::int64_t kLateNs = 1'000'000'000;
  /// Has no message of the service ever come?
  using IsSilent = std::function<bool()>;

  void on_gone(std::string name, IsSilent is_silent, std::int64_t now_ns) {
    waiting_.push_back({std::move(name), std::move(is_silent), now_ns + kLateNs});
  }
  /// Whatever comes from now on is not of its former time.
  void on_there(const std::string& name);
  [[nodiscard]] bool empty() const { return waiting_.empty() && count_ == 0; }

  /// A sentence about those not told yet; none within NewsPace::kPeriodNs of the last one.
  [[nodiscard]] std::vector<std::string> news(std::int64_t now_ns);
  /// As news(), at the end: whatever the time is.
  [[nodiscard]] std::vector<std::string> rest();

 private:
  struct Gone {
    std::string name;
    IsSilent is_silent;
    std::int64_t due_ns = 0;
  };
  void judge(const Gone& gone);

  std::deque<Gone> waiting_;  ///< Limit: what comes and goes in kLateNs
  std::string first_;         ///< of those that are to be told
  std::size_t count_ = 0;
  NewsPace pace_;
};

}  // namespace gimnet::tool
