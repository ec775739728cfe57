// The control plane in a small simulated world (tests/sim), of which the input makes the choices:
// limits, faults, timing, and what each node asks for. The simulation's model checks each step of
// the conductor. Input: {u8 nodes, choices...}; behind its end a seed goes on.

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <span>

#include "base/log.hpp"
#include "fuzz/support/fuzz_input.hpp"
#include "tests/sim/world.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace gimnet;
  if (size == 0) return 0;
  set_log_level(LogLevel::off);
  sim::World::Options options;
  options.seed = 1;
  options.nodes = 2 + data[0] % 15u;
  options.choices = std::span(data + 1, size - 1);
  const sim::Report report = sim::World(options).run();
  if (!report.broken) return 0;
  for (const std::string& line : report.last) std::fprintf(stderr, "%s\n", line.c_str());
  const std::string_view checker = sim::name_of(report.broken->checker);
  std::fprintf(stderr, "checker %.*s: %s\n", static_cast<int>(checker.size()), checker.data(),
               report.broken->sentence.c_str());
  FUZZ_MUST(!report.broken);
  return 0;
}
