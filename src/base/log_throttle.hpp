#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <list>
#include <map>
#include <string>
#include <string_view>

#include "base/token_bucket.hpp"

namespace gimnet {

/// Bounds the lines of all kinds that may be written now. Thread safety: none.
class LogBudget {
 public:
  /// May a line be written? If not it is counted as left out. Twice as many as `per_s` in a burst.
  [[nodiscard]] bool take(std::uint64_t per_s, std::chrono::milliseconds now);
  void add_left_out(std::uint64_t lines) { left_out_ += lines; }
  /// Lines left out since this was last asked.
  [[nodiscard]] std::uint64_t take_left_out();

 private:
  TokenBucket bucket_;
  std::uint64_t left_out_ = 0;
};

/// Bounds the lines of one kind about one peer that may be written now. So a peer that makes the
/// same mistake again and again neither fills the log nor keeps others out of it. Thread safety:
/// none. Limits: knows the latest 1,024 subjects; one that is forgotten begins anew.
class LogThrottle {
 public:
  static constexpr std::size_t kSubjectsMax = 1'024;

  struct Verdict {
    bool write = false;
    std::uint64_t left_out =
        0;  ///< lines of this subject since the last one that was written; 0 unless `write`
  };
  /// May a line of that kind about that peer be written? If not it is counted as left out.
  [[nodiscard]] Verdict take(std::string_view reason, std::string_view peer, std::uint64_t per_s,
                             std::chrono::milliseconds now);
  /// Lines left out of subjects that were forgotten since this was last asked.
  [[nodiscard]] std::uint64_t take_forgotten();
  [[nodiscard]] std::size_t subjects() const { return by_name_.size(); }

 private:
  struct Subject {
    std::string name;
    TokenBucket bucket;
    std::uint64_t left_out = 0;
  };
  using Subjects = std::list<Subject>;  ///< Limit: kSubjectsMax

  Subject& find(std::string name);

  Subjects subjects_;  ///< the one that was asked for last is the first
  std::map<std::string_view, Subjects::iterator> by_name_;
  std::uint64_t forgotten_ = 0;
};

}  // namespace gimnet
