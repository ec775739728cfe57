#include "generator/scenario.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace gimnet::perf {
namespace {

struct Named {
  const char* name;
  Scenario scenario;
};

template <std::size_t count>
Findings fan_out_to(Engine& engine, const RunOptions& options) {
  return fan_out(engine, options, count);
}

template <std::size_t count, Writing writing = Writing::batched>
Findings pairs_of(Engine& engine, const RunOptions& options) {
  return pairs(engine, options, count, writing);
}

// ping_one_cpu and ping_two_cpus are one scenario here: where the processes run is the driver's
// affair.
constexpr Named kScenarios[] = {
    {"one_to_one", pairs_of<1>},
    {"one_to_one_unbatched", pairs_of<1, Writing::unbatched>},
    {"four_to_four", pairs_of<4>},
    {"in_turns", in_turns},
    {"fan_out_10", fan_out_to<10>},
    {"fan_out_100", fan_out_to<100>},
    {"fan_out_1000", fan_out_to<1000>},
    {"list_100", list_100},
    {"ping_one_cpu", ping},
    {"ping_two_cpus", ping},
    {"ping_paced", ping_paced},
    {"ping_under_bulk", ping_under_bulk},
    {"stalled_subscriber", stalled_subscriber},
    {"idle_10000", idle},
    {"idle_alone", idle_alone},
    {"connect_10000", connect_many},
};

double percentile_us(const std::vector<std::int64_t>& sorted_ns, double share) {
  if (sorted_ns.empty()) return 0;
  const auto index = static_cast<std::size_t>(share * static_cast<double>(sorted_ns.size()));
  return static_cast<double>(sorted_ns[std::min(index, sorted_ns.size() - 1)]) / 1000.0;
}

}  // namespace

void add_percentiles(Findings& findings, std::vector<std::int64_t>& round_trips_ns) {
  constexpr std::pair<const char*, double> kShares[] = {
      {"p10_us", 0.1}, {"p25_us", 0.25}, {"p50_us", 0.5},    {"p75_us", 0.75},
      {"p90_us", 0.9}, {"p99_us", 0.99}, {"p999_us", 0.999}, {"max_us", 1}};
  std::sort(round_trips_ns.begin(), round_trips_ns.end());
  for (const auto& [name, share] : kShares)
    findings.add(name, percentile_us(round_trips_ns, share));
}

std::string Findings::json() const {
  std::string text = "{";
  for (const auto& [name, value] : values_) {
    char number[64];
    std::snprintf(number, sizeof(number), "%.12g", std::isfinite(value) ? value : 0.0);
    text += (text.size() > 1 ? ", \"" : "\"") + name + "\": " + number;
  }
  return text + "}";
}

void add_ledger(Engine& engine, Findings& findings) {
  if (!engine.wire().ask_for_ledger(engine.client(0))) return;
  const auto answered = [&engine] { return engine.wire().ledger().has_value(); };
  if (!engine.poll_until(answered, engine.answer_limit()))
    fail("the subject did not answer STATISTICS in time");
  const Ledger ledger = *engine.wire().ledger();
  const auto gap = static_cast<std::int64_t>(ledger.accepted + ledger.copies - ledger.delivered -
                                             ledger.dropped - ledger.queued);
  findings.add("dropped_frames", static_cast<double>(ledger.dropped));
  findings.add("queued_frames", static_cast<double>(ledger.queued));
  findings.add("ledger_gap", static_cast<double>(gap));
}

Scenario find_scenario(const std::string& name) {
  for (const auto& entry : kScenarios) {
    if (name == entry.name) return entry.scenario;
  }
  return nullptr;
}

std::vector<std::string> scenario_names() {
  std::vector<std::string> names;
  for (const auto& entry : kScenarios) names.emplace_back(entry.name);
  return names;
}

}  // namespace gimnet::perf
