// One of two programs that talk with each other through a hub by means of a library: which library
// is decided by what this is linked with. perf/run.py starts both, first the one that answers, and
// the hub.
//
//     library_client_nif --role receiver --connect tcp://127.0.0.1:7450
//     library_client_nif --role sender --connect tcp://127.0.0.1:7450 --hub PID --partner PID

#include <CLI/CLI.hpp>
#include <cstdio>
#include <string>

#include "generator/messages.hpp"
#include "generator/process.hpp"
#include "library/library_client.hpp"
#include "library/pair.hpp"
#include "net/socket.hpp"

void gimnet::perf::say_ready() {
  std::puts("ready");
  std::fflush(stdout);
}

int main(int argc, char** argv) {
  using namespace gimnet::perf;
  CLI::App app{"library_client: one of two programs that talk through a hub"};
  std::string role;
  LibraryClient::Setup setup;
  PairOptions options;
  double seconds = 1;
  double patience = 2;
  app.add_option("--role", role)
      ->required()
      ->check(CLI::IsMember({"sender", "receiver", "pinger", "echo"}));
  app.add_option("--connect", setup.url, "tcp://HOST:PORT or unix:PATH")->required();
  app.add_option("--hub", options.hub, "process id of the hub, for who measures");
  app.add_option("--partner", options.partner, "process id of the partner, for who measures");
  app.add_option("--size", options.payload_bytes, "payload in bytes")
      ->check(CLI::Range(kPayloadBytesMin, kPayloadBytesMax));
  app.add_option("--seconds", seconds, "how long is measured")->check(CLI::Range(0.01, 3600.0));
  app.add_option("--patience", patience, "seconds after which a message that has not come is lost")
      ->check(CLI::Range(0.1, 600.0));
  CLI11_PARSE(app, argc, argv);

  options.duration = std::chrono::nanoseconds(static_cast<std::int64_t>(seconds * 1e9));
  options.patience = std::chrono::nanoseconds(static_cast<std::int64_t>(patience * 1e9));
  setup.is_first = role == "receiver" || role == "echo";
  setup.own = setup.is_first ? "second" : "first";
  setup.partner = setup.is_first ? "first" : "second";
  const auto client = make_library_client();
  if (role == "receiver") receive_bursts(*client, setup, options);
  if (role == "echo") echo(*client, setup, options);
  Findings findings = role == "sender" ? send_bursts(*client, setup, options)
                                       : make_round_trips(*client, setup, options);
  findings.add("rss_peak_bytes", static_cast<double>(peak_resident_bytes(options.hub)));
  std::puts(findings.json().c_str());
}
