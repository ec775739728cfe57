#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "gimnet/gimi.hpp"
#include "tools/gimnet/news_pace.hpp"

namespace gimnet::tool {

/// What did not come of services, by the gaps between the numbers of what came, and when to say so. Times are those of
/// steady_now_ns(). Thread safety: one thread.
class MissedMessages {
 public:
  /// Returns how many of its service did not come up to this one. REQUIRES: it is of a service.
  std::uint64_t take(const Message& message);
  /// Sentences about what was not told yet, one a service; none within NewsPace::kPeriodNs of the last ones.
  [[nodiscard]] std::vector<std::string> news(std::int64_t now_ns);
  /// As news(), at the end: whatever the time is.
  [[nodiscard]] std::vector<std::string> rest();

 private:
  struct Service {
    std::uint32_t provider = 0;
    std::uint32_t sequence = 0;
    std::uint64_t missed = 0;
    std::uint64_t told = 0;
  };
  std::map<std::string, Service, std::less<>> services_;
  NewsPace pace_;
  bool untold_ = false;
};

}  // namespace gimnet::tool
