#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "generator/engine.hpp"
#include "generator/flood.hpp"

namespace gimnet::perf {

/// The order for a run.
struct RunOptions {
  std::size_t payload_bytes = 16;
  std::chrono::nanoseconds duration{1'000'000'000};
  pid_t process = 0;             ///< the measured hub or relay
  std::size_t client_count = 0;  ///< of idle and connect_many; 0: the scenario's own
};

/// The results of a run: names and numbers, printed as one JSON object.
class Findings {
 public:
  void add(std::string name, double value) { values_.emplace_back(std::move(name), value); }
  [[nodiscard]] std::string json() const;

 private:
  std::vector<std::pair<std::string, double>> values_;
};

/// Adds the distribution of round trips, `p10_us` to `p999_us` and `max_us`. Sorts them.
void add_percentiles(Findings& findings, std::vector<std::int64_t>& round_trips_ns);

/// Adds what the subject itself says that it dropped and kept, and `ledger_gap`: what its account
/// does not explain.
void add_ledger(Engine& engine, Findings& findings);

using Scenario = Findings (*)(Engine& engine, const RunOptions& options);

/// nullptr for an unknown name. The names are those of docs/performance.md.
[[nodiscard]] Scenario find_scenario(const std::string& name);
[[nodiscard]] std::vector<std::string> scenario_names();

// The scenarios, by the file that they are in.

// throughput_scenarios.cpp: hub CPU per delivered message; the last one has a subscriber that does
// not read beside one that does.
Findings pairs(Engine& engine, const RunOptions& options, std::size_t pair_count, Writing writing);
Findings in_turns(Engine& engine, const RunOptions& options);
Findings list_100(Engine& engine, const RunOptions& options);
Findings fan_out(Engine& engine, const RunOptions& options, std::size_t subscriber_count);
Findings stalled_subscriber(Engine& engine, const RunOptions& options);

// ping_scenarios.cpp: round trips.
Findings ping(Engine& engine, const RunOptions& options);
Findings ping_paced(Engine& engine, const RunOptions& options);
Findings ping_under_bulk(Engine& engine, const RunOptions& options);

// connection_scenarios.cpp: what many connections cost.
Findings idle(Engine& engine, const RunOptions& options);
Findings idle_alone(Engine& engine, const RunOptions& options);
Findings connect_many(Engine& engine, const RunOptions& options);

}  // namespace gimnet::perf
