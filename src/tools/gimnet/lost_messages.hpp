#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "gimnet/gimi.hpp"
#include "tools/gimnet/news_pace.hpp"

namespace gimnet::tool {

/// Why messages did not come: a full queue, and who filled it, if that is known.
[[nodiscard]] std::string queue_full_words(std::string_view whose, const Peer& filled_by);

/// What was lost on its way to this node, and when to say so. Thread safety: one thread.
class LostMessages {
 public:
  /// As the node counts them now.
  void take(const LostCounts& counts) { counts_ = counts; }
  [[nodiscard]] std::uint64_t all() const { return counts_.all(); }

  /// Sentences about what was not told yet, one a reason; none within NewsPace::kPeriodNs of the
  /// last ones.
  [[nodiscard]] std::vector<std::string> news(std::int64_t now_ns);
  /// As news(), at the end: whatever the time is.
  [[nodiscard]] std::vector<std::string> rest();

 private:
  LostCounts counts_;
  LostCounts told_;
  NewsPace pace_;
};

}  // namespace gimnet::tool
