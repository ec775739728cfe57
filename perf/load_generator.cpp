// Runs one scenario against one subject and prints what it found as one JSON object. perf/run.py
// starts it, beside the subject and on the right processor; docs/performance.md says what the
// scenarios are.
//
//     load_generator --connect tcp://127.0.0.1:7450 --process PID --scenario
//     one_to_one --size 16

#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>

#include "generator/engine.hpp"
#include "generator/gimnet_wire.hpp"
#include "generator/process.hpp"
#include "generator/scenario.hpp"
#include "net/socket.hpp"

int main(int argc, char** argv) {
  using namespace gimnet::perf;
  CLI::App app{"load_generator: measures a hub, or the null relay, from outside"};
  bool is_null = false;
  std::string url;
  std::string scenario_name;
  double seconds = 1;
  double patience = 2;
  RunOptions options;
  app.add_flag("--null", is_null, "the subject is the null relay: no handshake");
  app.add_option("--connect", url, "tcp://HOST:PORT or unix:PATH")->required();
  app.add_option("--process", options.process, "process id of the subject")->required();
  app.add_option("--scenario", scenario_name)->required()->check(CLI::IsMember(scenario_names()));
  app.add_option("--size", options.payload_bytes, "payload in bytes")
      ->check(CLI::Range(kPayloadBytesMin, kPayloadBytesMax));
  app.add_option("--seconds", seconds, "how long is measured")->check(CLI::Range(0.01, 3600.0));
  app.add_option("--patience", patience, "seconds after which a message that has not come is lost")
      ->check(CLI::Range(0.1, 600.0));
  app.add_option("--clients", options.client_count, "connections of idle_10000 and connect_10000")
      ->check(CLI::Range(2, 1'000'000));
  CLI11_PARSE(app, argc, argv);

  options.duration = std::chrono::nanoseconds(static_cast<std::int64_t>(seconds * 1e9));
  raise_descriptor_limit();
  Wire null_wire;
  GimnetWire gimnet_wire;
  Engine engine(is_null ? null_wire : gimnet_wire, url);
  engine.set_patience(std::chrono::nanoseconds(static_cast<std::int64_t>(patience * 1e9)));
  Findings findings = find_scenario(scenario_name)(engine, options);
  findings.add("rss_peak_bytes", static_cast<double>(peak_resident_bytes(options.process)));
  add_ledger(engine, findings);
  std::puts(findings.json().c_str());
}
