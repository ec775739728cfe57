#include "tests/stress/support/statistics.hpp"

#include <optional>
#include <stdexcept>

namespace gimnet::stress {

Statistics Statistics::of(RawNode& observer) {
  return Statistics(
      observer.ask<proto::ctrl::StatisticsAnswer>(proto::Kind::ctrl, proto::ctrl::Statistics{}));
}

Statistics::Statistics(const proto::ctrl::StatisticsAnswer& answer) {
  for (const auto& shard : answer.shards) {
    for (const auto& counter : shard.counters) {
      counters_[counter.name] += counter.value;
      by_shard_[shard.shard][counter.name] = counter.value;
    }
  }
}

std::uint64_t Statistics::dropped() const {
  std::uint64_t sum = 0;
  for (const auto& [name, value] : counters_) {
    if (name.starts_with("dropped.")) sum += value;
  }
  return sum;
}

bool Statistics::is_balanced() const {
  return (*this)["accepted"] + (*this)["copies"] ==
         (*this)["delivered"] + dropped() + (*this)["queued"];
}

bool Statistics::has_the_ledger_of(const Statistics& other) const {
  const auto same = [&](const char* name) { return (*this)[name] == other[name]; };
  return same("accepted") && same("copies") && same("delivered") && same("queued") &&
         dropped() == other.dropped();
}

std::string Statistics::text() const {
  std::string text;
  for (const auto& [name, value] : counters_) {
    if (value != 0) text += name + "=" + std::to_string(value) + " ";
  }
  return text;
}

Statistics wait_for_exact_ledger(RawNode& observer) {
  std::optional<Statistics> last;
  const auto is_settled = [&](const Statistics& now) {
    const bool settled = last && now.is_balanced() && now.has_the_ledger_of(*last);
    last = now;
    return settled;
  };
  return wait_for(observer, is_settled, "a quiet hub with an exact ledger");
}

Statistics wait_for(RawNode& observer, const std::function<bool(const Statistics&)>& condition,
                    const std::string& what) {
  const Deadline deadline;
  for (;;) {
    Statistics statistics = Statistics::of(observer);
    if (condition(statistics)) return statistics;
    if (deadline.is_over())
      throw std::runtime_error("waited in vain: " + what + ": " + statistics.text());
    wait_readable({}, 5);
  }
}

}  // namespace gimnet::stress
