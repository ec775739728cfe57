#include "hub/config/options.hpp"

#include <sched.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string_view>

#include "base/suggest.hpp"
#include "hub/version.hpp"
#include "proto/control/names.hpp"

namespace gimnet::hub {
namespace {

constexpr std::array<std::string_view, 12> kOptionNames{"--listen",    "--shards",   "--hub-id",    "--hub-name",
                                                        "--state-dir", "--limit",    "--help",      "--help-limits",
                                                        "--placement", "--insecure", "--log-level", "--version"};
constexpr std::array<std::string_view, 2> kPlacements{"spread", "hint"};
constexpr std::array<std::string_view, 5> kLogLevels{"error", "warning", "info", "debug", "off"};

/// The arguments as they were given.
struct Raw {
  std::vector<std::string> listen;
  std::string shards;
  std::string hub_id;
  std::string hub_name;
  std::string state_dir;
  std::vector<std::string> limits;
  std::string placement;
  std::string log_level;
  bool insecure = false;
  bool help_limits = false;
  bool version = false;
};

CommandLineEnding wrong(const std::string& sentence) { return {2, "tcphub: " + sentence + "\n"}; }

std::optional<std::size_t> number_in(std::string_view text, std::size_t least, std::size_t most) {
  std::size_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || value < least || value > most) return std::nullopt;
  return value;
}

void declare(CLI::App& app, Raw& raw) {
  app.allow_extras();
  app.add_option("--listen", raw.listen,
                 "Address to listen on, may be repeated: tcp://127.0.0.1:7450, tcp://[::1]:0 (any free port),\n"
                 "unix:/path. Default: tcp://127.0.0.1:7450 and a Unix socket in the user's runtime folder")
      ->type_name("URL")
      ->expected(1)
      ->take_all();
  app.add_option("--shards", raw.shards, "Threads that carry data, 1 to 16. Default: half of the processors, at most 8")
      ->type_name("N");
  app.add_option("--hub-id", raw.hub_id, "This hub's number in its network, 1 to 4094. Default: 1")->type_name("N");
  app.add_option("--hub-name", raw.hub_name, "Its name for people. Default: hub-ID")->type_name("NAME");
  app.add_option("--state-dir", raw.state_dir, "Folder for what the hub keeps, created if needed")->type_name("DIR");
  app.add_option("--limit", raw.limits, "Sets a limit, may be repeated; --help-limits lists them")
      ->type_name("NAME=VALUE")
      ->expected(1)
      ->take_all();
  app.add_flag("--help-limits", raw.help_limits, "Lists all limits and ends");
  app.add_option("--placement", raw.placement,
                 "Where new nodes live: spread (the least loaded shard; default) or hint (as HELLO wishes)")
      ->type_name("HOW");
  app.add_flag("--insecure", raw.insecure, "Allows to listen on addresses that other machines reach");
  app.add_option("--log-level", raw.log_level, "error, warning, info (default), debug or off")->type_name("LEVEL");
  app.add_flag("--version", raw.version, "Says the version and ends");
}

std::string help_limits() {
  const Limits defaults;
  std::string text = "Limits, set with --limit NAME=VALUE (k, M and G are powers of 1,024):\n\n";
  for (const LimitInfo& limit : limit_table()) {
    std::string line = "  " + std::string{limit.name};
    line.resize(std::max<std::size_t>(line.size(), 25), ' ');
    line += std::to_string(defaults.*limit.field) + " " + std::string{limit.unit};
    line.resize(std::max<std::size_t>(line.size(), 50), ' ');
    text += line + " " + std::string{limit.reason} + " (" + std::to_string(limit.least) + " to " +
            std::to_string(limit.most) + ")\n";
  }
  return text;
}

/// Limits that only make sense together.
std::string limits_error(const Limits& limits) {
  if (limits.silent_ms <= limits.keep_alive_ms) {
    return "limit silent_ms (" + std::to_string(limits.silent_ms) + ") must be larger than keep_alive_ms (" +
           std::to_string(limits.keep_alive_ms) + "), or healthy nodes are closed as silent";
  }
  return {};
}

std::string read_listen(const Raw& raw, HubOptions& options) {
  for (const std::string& text : raw.listen) {
    const Result<ListenUrl> url = parse_listen_url(text);
    if (!url) return url.error().sentence;
    if (!url->is_local() && !raw.insecure) {
      return "cannot listen on " + url->text() + ": an open address needs TLS, or --insecure";
    }
    if (std::find(options.listen.begin(), options.listen.end(), *url) != options.listen.end() && url->port != 0) {
      return "--listen " + text + " is given twice";
    }
    options.listen.push_back(*url);
  }
  return {};
}

std::string read_names(const Raw& raw, HubOptions& options) {
  if (!raw.hub_id.empty()) {
    const auto id = number_in(raw.hub_id, 1, kHubIdMax);
    if (!id) return "--hub-id cannot be '" + raw.hub_id + "': give a whole number from 1 to 4094";
    options.id = HubId{static_cast<std::uint16_t>(*id)};
  }
  options.name = raw.hub_name.empty() ? "hub-" + std::to_string(options.id.value()) : raw.hub_name;
  if (const char* fault = proto::name_fault(options.name)) {
    return "--hub-name cannot be '" + escaped(options.name, 60) + "': " + fault;
  }
  options.state_dir = raw.state_dir;
  options.insecure = raw.insecure;
  return {};
}

std::string read_running(const Raw& raw, HubOptions& options) {
  options.shards = default_shards();
  if (!raw.shards.empty()) {
    const auto shards = number_in(raw.shards, 1, kShardCountMax);
    if (!shards) {
      return "--shards cannot be '" + raw.shards + "': give a whole number from 1 to " + std::to_string(kShardCountMax);
    }
    options.shards = *shards;
  }
  if (!raw.placement.empty()) {
    if (raw.placement != "spread" && raw.placement != "hint") {
      return "--placement cannot be '" + raw.placement + "': spread or hint" + did_you_mean(raw.placement, kPlacements);
    }
    options.placement = raw.placement == "hint" ? Placement::hint : Placement::spread;
  }
  if (!raw.log_level.empty() && !parse_log_level(raw.log_level, options.log_level)) {
    return "--log-level cannot be '" + raw.log_level + "': error, warning, info, debug or off" +
           did_you_mean(raw.log_level, kLogLevels);
  }
  for (const std::string& assignment : raw.limits) {
    if (std::string error = set_limit(options.limits, assignment); !error.empty()) return error;
  }
  return limits_error(options.limits);
}

/// What CLI11 found, in the words of this house.
std::string syntax_error(const CLI::ParseError& error) {
  std::string what = error.what();
  if (what.empty()) what = error.get_name();
  return what + "; tcphub --help shows what there is";
}

}  // namespace

std::size_t default_shards() {
  cpu_set_t set;
  CPU_ZERO(&set);
  const int processors = ::sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
  return static_cast<std::size_t>(std::clamp(processors / 2, 1, 8));
}

std::variant<HubOptions, CommandLineEnding> parse_command_line(int argc, const char* const* argv) {
  CLI::App app{"tcphub carries messages between the nodes of a GIMnet.", "tcphub"};
  Raw raw;
  declare(app, raw);
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    return CommandLineEnding{0, app.help()};
  } catch (const CLI::ParseError& error) {
    return wrong(syntax_error(error));
  }
  if (const std::vector<std::string> extras = app.remaining(); !extras.empty()) {
    const std::string word = extras.front().substr(0, extras.front().find('='));
    return wrong("there is no argument '" + escaped(word, 60) + "'" + did_you_mean(word, kOptionNames) +
                 " (tcphub --help shows all)");
  }
  if (raw.version) return CommandLineEnding{0, std::string{"tcphub "} + kVersion + "\n"};
  if (raw.help_limits) return CommandLineEnding{0, help_limits()};
  HubOptions options;
  for (const auto read : {read_listen, read_names, read_running}) {
    if (const std::string error = read(raw, options); !error.empty()) return wrong(error);
  }
  return options;
}

}  // namespace gimnet::hub
