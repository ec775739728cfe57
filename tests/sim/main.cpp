#include <charconv>
#include <chrono>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <string>
#include <string_view>

#include "base/log.hpp"
#include "tests/sim/shrink.hpp"

// ./dev sim: the deterministic simulation of the control plane. See README.md.

namespace gimnet::sim {
namespace {

constexpr const char* kUsage =
    "usage: gimnet-sim [--seeds N] [--from SEED] [--seed SEED] [--nodes N] [--without FAULT,...]\n"
    "                  [--trace] [--hashes] [--hashes-to FILE] [--every-fault] [--expect CHECKER] "
    "[--checkers]\n"
    "  --seeds N         so many worlds (500), from seed 1 on; in 500 each fault and collision "
    "must come\n"
    "  --from SEED       from that seed on\n"
    "  --seed SEED       that one world only\n"
    "  --nodes N         nodes in a world (200)\n"
    "  --without FAULTS  leave these kinds of faults out, though a seed has them: crash,hang\n"
    "  --trace           print every event of the world as it happens\n"
    "  --hashes          print the hash of each world's trace, and nothing else\n"
    "  --hashes-to FILE  write the hash of each world's trace there, if nothing was wrong\n"
    "  --every-fault     fail if a fault or collision never came, also in fewer worlds\n"
    "  --expect CHECKER  succeed only if that checker finds something: for planted bugs\n"
    "  --checkers        the names of the checkers\n";

/// In so many worlds each fault and collision comes, where none is left out.
constexpr std::uint64_t kSeeds = 500;

struct Arguments {
  std::uint64_t from = 1;
  std::uint64_t seeds = kSeeds;
  World::Options world;
  bool hashes = false;
  bool every_fault = false;
  std::string hashes_file;
  std::string_view expect;
};

[[noreturn]] void usage(const std::string& fault) {
  std::fprintf(stderr, "gimnet-sim: %s\n%s", fault.c_str(), kUsage);
  std::exit(2);
}

std::uint64_t number(std::string_view flag, const char* text) {
  std::uint64_t value = 0;
  const char* end = text + std::strlen(text);
  const auto [stop, error] = std::from_chars(text, end, value);
  if (error != std::errc{} || stop != end) {
    usage("'" + std::string{text} + "' is not a whole number; write " + std::string{flag} + " N");
  }
  return value;
}

std::string fault_names() {
  std::string names;
  for (const Fault& fault : kFaults) names.append(names.empty() ? "" : ", ").append(fault.name);
  return names;
}

void print_checkers() {
  for (const std::string_view name : kCheckerNames)
    std::printf("%.*s\n", static_cast<int>(name.size()), name.data());
}

void read_value(Arguments& arguments, std::string_view flag, const char* value) {
  if (value == nullptr) usage(std::string{flag} + " wants a value");
  if (flag == "--expect") {
    arguments.expect = value;
    return;
  }
  if (flag == "--hashes-to") {
    arguments.hashes_file = value;
    return;
  }
  if (flag == "--without") {
    std::string unknown;
    arguments.world.without = faults_of(value, unknown);
    if (!unknown.empty()) usage("there is no fault '" + unknown + "': " + fault_names());
    return;
  }
  const std::uint64_t count = number(flag, value);
  if (flag == "--seeds") {
    arguments.seeds = count;
  } else if (flag == "--from") {
    arguments.from = count;
  } else if (flag == "--seed") {
    arguments.from = count;
    arguments.seeds = 1;
  } else if (count < 2 || count > 5'000) {
    usage("a world has 2 to 5000 nodes");
  } else {
    arguments.world.nodes = static_cast<std::size_t>(count);
  }
}

Arguments read(int count, char** values) {
  Arguments arguments;
  for (int i = 1; i < count; ++i) {
    const std::string_view flag = values[i];
    if (flag == "--help") {
      std::printf("%s", kUsage);
      std::exit(0);
    } else if (flag == "--checkers") {
      print_checkers();
      std::exit(0);
    } else if (flag == "--trace") {
      arguments.world.print = true;
    } else if (flag == "--hashes") {
      arguments.hashes = true;
    } else if (flag == "--every-fault") {
      arguments.every_fault = true;
    } else if (flag == "--seeds" || flag == "--from" || flag == "--seed" || flag == "--nodes" ||
               flag == "--without" || flag == "--expect" || flag == "--hashes-to") {
      read_value(arguments, flag, i + 1 < count ? values[i + 1] : nullptr);
      ++i;
    } else {
      usage("there is no option '" + std::string{flag} + "'");
    }
  }
  return arguments;
}

void print_failure(const World::Options& world, const Report& report) {
  for (const std::string& line : report.last) std::printf("%s\n", line.c_str());
  const std::string_view checker = name_of(report.broken->checker);
  std::printf("\nseed %" PRIu64 " broke at event %" PRIu64 ", step %" PRIu64 " of the conductor\n",
              report.seed, report.events, report.steps);
  std::printf("checker %.*s: %s\n", static_cast<int>(checker.size()), checker.data(),
              report.broken->sentence.c_str());
  std::printf("again: ./dev sim %s --trace\n", arguments_of(world).c_str());
}

/// Finds and prints the smallest world that breaks in the same way.
void print_smallest(const World::Options& world, const Report& report) {
  const Shrunk smallest = shrink(world, report);
  std::printf("smaller, of %" PRIu64 " worlds that were tried, after %" PRIu64
              " events instead of %" PRIu64 ": ./dev sim %s --trace\n",
              smallest.tried, smallest.report.events, report.events,
              arguments_of(smallest.world).c_str());
  std::printf(
      "its line in tests/sim/regression_seeds.txt says `SEED NODES [--without FAULT,...]` of "
      "that\n");
}

/// Must each fault and collision have come?
bool must_have_everything(const Arguments& arguments) {
  return arguments.every_fault || (arguments.seeds >= kSeeds && arguments.world.without.none());
}

int judge(const Arguments& arguments, const Census& census, std::uint64_t steps) {
  if (!arguments.expect.empty()) {
    std::printf("checker %.*s found nothing in %" PRIu64 " worlds\n",
                static_cast<int>(arguments.expect.size()), arguments.expect.data(),
                arguments.seeds);
    return 1;
  }
  if (arguments.hashes) return 0;
  std::printf("%s%" PRIu64 " worlds of %zu nodes, %" PRIu64
              " steps of the conductor: nothing wrong\n",
              census.table().c_str(), arguments.seeds, arguments.world.nodes, steps);
  const std::vector<std::string> missing = census.missing();
  std::string names;
  for (const std::string& name : missing) names.append(names.empty() ? "" : ", ").append(name);
  if (!missing.empty()) std::printf("never happened: %s\n", names.c_str());
  return missing.empty() || !must_have_everything(arguments) ? 0 : 1;
}

/// Whole or not at all: who compares the hashes must not take those of some worlds for all.
bool write_hashes(const std::string& path, const std::string& hashes) {
  std::FILE* const file = std::fopen(path.c_str(), "w");
  const bool written = file != nullptr && std::fputs(hashes.c_str(), file) >= 0;
  const bool closed = file != nullptr && std::fclose(file) == 0;
  if (written && closed) return true;
  std::fprintf(stderr, "gimnet-sim: cannot write %s\n", path.c_str());
  std::remove(path.c_str());
  return false;
}

int run(const Arguments& arguments) {
  set_log_level(LogLevel::off);
  Census census;
  std::uint64_t steps = 0;
  std::string hashes;
  for (std::uint64_t seed = arguments.from; seed - arguments.from < arguments.seeds; ++seed) {
    World::Options options = arguments.world;
    options.seed = seed;
    const Report report = World(options).run();
    char line[64];
    std::snprintf(line, sizeof line, "%" PRIu64 " %016" PRIx64 "\n", seed, report.hash);
    if (arguments.hashes) std::printf("%s", line);
    hashes += line;
    if (report.broken) {
      // A planted bug shows itself in more than one way: another checker may be the first in this
      // world.
      if (!arguments.expect.empty() && arguments.expect != name_of(report.broken->checker))
        continue;
      print_failure(options, report);
      if (!arguments.expect.empty()) return 0;
      if (!arguments.hashes && !arguments.world.print) print_smallest(options, report);
      return 1;
    }
    census.add(report.census);
    steps += report.steps;
  }
  if (!arguments.hashes_file.empty() && !write_hashes(arguments.hashes_file, hashes)) return 1;
  return judge(arguments, census, steps);
}

}  // namespace
}  // namespace gimnet::sim

int main(int count, char** values) { return gimnet::sim::run(gimnet::sim::read(count, values)); }
