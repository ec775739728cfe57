#include "tools/gimnet/impair.hpp"

#include <CLI/CLI.hpp>
#include <charconv>
#include <cstdint>
#include <span>
#include <vector>

#include "impair/delayed_channel.hpp"
#include "impair/fault_proxy.hpp"
#include "tools/gimnet/command_options.hpp"
#include "tools/gimnet/input.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/output.hpp"
#include "tools/gimnet/session.hpp"

namespace gimnet::tool {
namespace {

constexpr const char* kImpairAbout =
    R"(Relay connections, and do to them what a bad network does: to try programs under it.

Examples:
  gimnet impair tcp://127.0.0.1:7460 tcp://127.0.0.1:7450 --delay 80ms --jitter 5ms --rate 1MB
  gimnet --hub tcp://127.0.0.1:7460 ping B  B behind 80 ms, each way

Prints `ready tcp://127.0.0.1:7460` and relays until Ctrl-C. Lines of standard input change it while it runs, and each is
answered with a line: `rate 100kB` or another setting; `stall`, `stall up 500ms`, `go`; `cut`; `refuse`, `accept`; `status`.
TCP carries the faults: what a network loses comes late, never wrong or in another order.
)";

void add_setting(CLI::App& command, ImpairOptions& options, const std::string& name,
                 const std::string& about) {
  command.add_option_function<std::string>(
      "--" + name,
      [&options, name](const std::string& word) {
        const auto changed = impair::change_setting(options.how, name, word);
        if (!changed) throw CLI::ValidationError("--" + name, changed.error().sentence);
        options.how = *changed;
      },
      about);
}

std::vector<std::string_view> words_of(std::string_view line) {
  constexpr std::string_view kBlank = " \t\r";
  std::vector<std::string_view> words;
  for (;;) {
    const std::size_t begin = line.find_first_not_of(kBlank);
    if (begin == std::string_view::npos) return words;
    line.remove_prefix(begin);
    words.push_back(line.substr(0, line.find_first_of(kBlank)));
    line.remove_prefix(words.back().size());
  }
}

std::string error(const std::string& sentence) { return "error: " + sentence; }

std::string stall(impair::FaultProxy& proxy, std::span<const std::string_view> words) {
  impair::RelayDirection way = impair::RelayDirection::both;
  if (!words.empty() && (words[0] == "up" || words[0] == "down")) {
    way = words[0] == "up" ? impair::RelayDirection::up : impair::RelayDirection::down;
    words = words.subspan(1);
  }
  if (words.size() > 1) return error("stall takes [up|down] [TIME]");
  std::int64_t duration_ns = impair::DelayedChannel::kNever;
  if (!words.empty()) {
    const auto parsed = impair::parse_duration(words[0]);
    if (!parsed) return error(parsed.error().sentence);
    duration_ns = *parsed;
  }
  proxy.stall(way, duration_ns);
  return "ok";
}

std::string status(const impair::FaultProxy& proxy) {
  const impair::Relayed relayed = proxy.relayed();
  JsonWriter json;
  json.begin_object()
      .member("connections", relayed.connections)
      .member("accepted", relayed.accepted)
      .member("refused", relayed.refused)
      .member("cut", relayed.cut)
      .member("stalls", relayed.stalls)
      .member("up_bytes", relayed.up_bytes)
      .member("down_bytes", relayed.down_bytes);
  return json.end_object().str();
}

/// True: it was one of the words that stand alone.
bool did_plain_word(impair::FaultProxy& proxy, std::string_view word) {
  if (word == "go") {
    proxy.go();
  } else if (word == "cut") {
    proxy.cut();
  } else if (word == "refuse" || word == "accept") {
    proxy.refuse(word == "refuse");
  } else {
    return false;
  }
  return true;
}

}  // namespace

std::string obey(impair::FaultProxy& proxy, std::string_view line) {
  const std::vector<std::string_view> words = words_of(line);
  if (words.empty()) return "ok";
  if (words[0] == "stall") return stall(proxy, std::span(words).subspan(1));
  if (words.size() == 1 && words[0] == "status") return status(proxy);
  if (words.size() == 1 && did_plain_word(proxy, words[0])) return "ok";
  if (words.size() != 2) {
    return error(
        "'" + std::string(line) +
        "' is no order: give stall [up|down] [TIME], go, cut, refuse, accept, status, or a "
        "setting and its value (" +
        std::string(impair::kSettingNames) + ")");
  }
  const auto changed = impair::change_setting(proxy.impairment(), words[0], words[1]);
  if (!changed) return error(changed.error().sentence);
  proxy.change(*changed);
  return "ok";
}

void add_impair(CLI::App& app, ImpairOptions& options) {
  CLI::App& command = *app.add_subcommand("impair", kImpairAbout);
  command.add_option("listen", options.listen, "where to listen: tcp://host:port or unix:/path")
      ->required()
      ->check(not_empty());
  command.add_option("target", options.target, "where to relay to: tcp://host:port or unix:/path")
      ->required()
      ->check(not_empty());
  add_setting(command, options, "delay", "of each byte, one way, such as 80ms, up to 60min");
  add_setting(command, options, "jitter",
              "by which the delay varies, such as 5ms; nothing overtakes");
  add_setting(command, options, "rate", "bytes a second, each way, such as 1MB");
  add_setting(command, options, "queue",
              "bytes held each way, such as 64KiB, default what passes in the delay and 100 ms");
  add_setting(command, options, "split", "write pieces of 1 to this many bytes, such as 7");
  add_setting(command, options, "stall-every",
              "mean time between stalls, such as 2s, default none");
  add_setting(command, options, "stall-for", "length of each, such as 300ms, default 200ms");
  add_setting(command, options, "cut-every",
              "mean time between cuts of all connections, such as 10s, default none");
  command.add_option("--seed", options.seed, "of what is drawn, a whole number, default 1");
}

ExitCode run_impair(const ImpairOptions& options, StopSignal& stop) {
  const auto listen = net::parse_address(options.listen, 0);
  const auto target = net::parse_address(options.target);
  for (const auto* each : {&listen, &target}) {
    if (*each) continue;
    say(each->error().sentence);
    return ExitCode::usage;
  }
  // With port 0 the kernel chooses another one than that of the target.
  if (*listen == *target) {
    say("cannot relay " + target->url() + " to itself: listen on another port or path");
    return ExitCode::usage;
  }
  auto opened = impair::FaultProxy::open(*listen, *target, options.how, options.seed);
  if (!opened) {
    say(opened.error().sentence);
    return ExitCode::failed;
  }
  impair::FaultProxy& proxy = **opened;
  Output output;
  output.write("ready " + proxy.url() + "\n");
  output.flush();
  LineInput input(0, stop.descriptor());
  std::string_view line;
  while (output.ok() && input.next(line) == LineInput::State::line) {
    output.write(obey(proxy, line) + "\n");
    output.flush();
  }
  // Without orders it goes on: the input of a program in the background ends at once.
  while (stop.wait_until(INT64_MAX)) {
  }
  return exit_code_of_signal(stop.signal());
}

}  // namespace gimnet::tool
