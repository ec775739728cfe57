#include "hub/config/options.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cctype>
#include <span>
#include <string_view>
#include <utility>

#include "base/suggest.hpp"
#include "hub/config/sources.hpp"
#include "hub/version.hpp"

namespace gimnet::hub {
namespace {

/// An option: its words in the help, and its value; without one it is a flag.
struct OptionText {
  const char* name;
  const char* takes;
  const std::string help;
};

/// In the order of the help.
const std::array<OptionText, 19>& option_texts() {
  static const std::array<OptionText, 19> texts{
      {{"-h,--help", "", "Says this and ends"},
       {"--listen", "URL",
        "Address to listen on, may be repeated: tcp://127.0.0.1:7450, tcp://[::1]:0 (any free "
        "port),\nunix:/path. Default: tcp://127.0.0.1:7450 and a Unix socket in the user's runtime "
        "folder"},
       {"--shards", "N",
        "Threads that carry data, 1 to 16. Default: half of the processors, at most 8"},
       {"--hub-id", "N",
        "This hub's number in its network, 1 to 4094. Default: 1, and a random one from 1024 on "
        "for "
        "a\nhub with --link"},
       {"--hub-name", "NAME", "Its name for people. Default: hub-ID"},
       {"--state-dir", "DIR", "Folder for what the hub keeps, created if needed"},
       {"--link", "URL",
        "Hub to link to, may be repeated: tcp://HOST:PORT or unix:/PATH. It must accept links"},
       {"--proxy", "URL", "HTTP proxy to dial links through: http://[USER:PASSWORD@]HOST:PORT"},
       {"--accept-links", "", "Takes links of other hubs, which may speak for nodes of theirs"},
       {"--limit", "NAME=VALUE", "Sets a limit, may be repeated; --help-limits lists them"},
       {"--help-limits", "", "Lists all limits and ends"},
       {"--placement", "HOW",
        "Where new nodes live: spread (the least loaded shard; default) or hint (as HELLO wishes)"},
       {"--spin", "", "Shards never sleep: shorter round trips, for a whole processor each"},
       {"--insecure", "",
        "Allows to listen on addresses that other machines reach, and links to other machines"},
       {"--log-level", "LEVEL", "error, warning, info (default), debug or off"},
       {"--config", "FILE",
        "Configuration file (TOML); conf.d/*.toml beside it are read too. Default: the first that "
        "is "
        "there of\ngimnet/tcphub.toml in the user's configuration folder, /etc/gimnet/tcphub.toml. "
        "No file is needed"},
       {"--check-config", "", "Says everything that is wrong with the configuration, and ends"},
       {"--print-config", "", "Shows every value and where it came from, and ends"},
       {"--version", "", "Says the version and ends"}}};
  return texts;
}

CommandLineEnding wrong(const std::string& sentence) { return {2, "tcphub: " + sentence + "\n"}; }

void declare(CLI::App& app) {
  app.allow_extras();
  app.set_help_flag();  // it knows no --help=false
  for (const OptionText& text : option_texts()) {
    if (*text.takes == '\0') {
      app.add_flag(text.name, text.help);
      continue;
    }
    CLI::Option* option = app.add_option(text.name, text.help)->type_name(text.takes);
    if (text.help.find("may be repeated") != std::string::npos) option->expected(1)->take_all();
  }
}

bool is_on(const CLI::App& app, const char* flag) {
  return app.count(flag) != 0 && app.get_option(flag)->as<bool>();
}

std::string help_limits() {
  const Limits defaults;
  std::string text =
      "Limits, set with --limit NAME=VALUE (k, M and G are powers of 1,024; times take no "
      "suffix):\n\n";
  std::string changing;
  for (const LimitInfo* limit : limit_settings()) {
    std::string line = "  " + std::string{limit->name};
    line.resize(std::max<std::size_t>(line.size(), 25), ' ');
    line += std::to_string(defaults.*(limit->field)) + " " + std::string{limit->unit};
    line.resize(std::max<std::size_t>(line.size(), 50), ' ');
    text += line + " " + std::string{limit->reason} + " (" + std::to_string(limit->least) + " to " +
            std::to_string(limit->most) + ")\n";
    if (limit->reloads) changing += (changing.empty() ? "" : ", ") + std::string{limit->name};
  }
  return text + "\nA reload changes: " + changing + ". The others need a restart.\n";
}

/// The value that the option takes, as the first sentence of its help has it.
std::string what_it_takes(const CLI::Option& option) {
  std::string takes = option.get_description();
  takes.erase(std::min(takes.find(". "), takes.size()));
  std::ranges::replace(takes, '\n', ' ');
  // An abbreviation stays as it is.
  const auto is_capital = [](char c) { return std::isupper(static_cast<unsigned char>(c)) != 0; };
  if (takes.size() > 1 && is_capital(takes[0]) && !is_capital(takes[1])) {
    takes[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(takes[0])));
  }
  return takes;
}

/// The error that CLI11 found, in the words of this house.
std::string syntax_error(const CLI::App& app, const CLI::ParseError& error) {
  std::string what = error.what();
  for (const CLI::Option* option : app.get_options()) {
    const std::string& name = option->get_name();
    if (!what.starts_with(name + ":")) continue;
    const std::size_t given = option->results().size();
    what = given > 1 ? name + " is given " + std::to_string(given) + " times: give it once"
                     : name + " needs a value: " + what_it_takes(*option);
    break;
  }
  if (what.empty()) what = error.get_name();
  return what + "; tcphub --help shows what there is";
}

/// A word `--NAME=VALUE` that cannot be, or "".
std::string wrong_word(const CLI::App& app, std::span<const char* const> words) {
  return wrong_option_word(words, [&app](std::string_view name) {
    const CLI::Option* option = app.get_option_no_throw(std::string{name});
    if (option == nullptr) return Takes::unknown;
    return option->get_items_expected_max() == 0 ? Takes::boolean : Takes::value;
  });
}

/// The argument for a word of other servers, or "".
std::string_view argument_meant(std::string_view word) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 7> kWords{{
      {"--port", "--listen"},
      {"-p", "--listen"},
      {"--host", "--listen"},
      {"--bind", "--listen"},
      {"--name", "--hub-name"},
      {"--id", "--hub-id"},
      {"-c", "--config"},
  }};
  const auto* const found = std::ranges::find(kWords, word, &decltype(kWords)::value_type::first);
  return found == kWords.end() ? std::string_view{} : found->second;
}

/// Why a word that CLI11 left over cannot be, or "". It leaves over the end of the options, too.
std::string leftover_fault(std::vector<std::string> words) {
  const auto end = std::ranges::find(words, "--");
  const bool behind_end = end == words.begin();
  if (end != words.end()) words.erase(end);
  if (words.empty()) return {};
  const std::string word =
      behind_end ? words.front() : words.front().substr(0, words.front().find('='));
  std::vector<std::string_view> names;
  for (const OptionText& text : option_texts())
    names.push_back(std::string_view{text.name}.substr(std::string_view{text.name}.find("--")));
  const std::string meant{argument_meant(word)};
  const std::string nearest =
      meant.empty() ? did_you_mean(word, names) : "; did you mean " + meant + "?";
  return "there is no argument '" + escaped(word, kQuotedMax) + "'" +
         (behind_end ? " behind --" : nearest) + " (tcphub --help shows all)";
}

Given flag(const std::string& key, const std::string& label, std::string text) {
  Given given;
  given.key = key;
  given.label = label;
  given.origin = "flag " + label;
  given.value.text = std::move(text);
  return given;
}

/// The flags that were given, as values of their keys. Returns what is wrong with their form, or
/// "".
std::string read_flags(const CLI::App& app, ConfigSources& sources) {
  for (const char* name : {"--listen", "--link"}) {
    if (app.count(name) == 0) continue;
    Given& urls = sources.flags.emplace_back(flag(name + 2, name, {}));
    urls.value.kind = ConfigValue::Kind::list;
    for (const std::string& url : app.get_option(name)->results())
      urls.value.items.push_back({ConfigValue::Kind::words, url, {}, {}});
  }
  for (const char* name : {"--shards", "--hub-id", "--hub-name", "--state-dir", "--accept-links",
                           "--placement", "--log-level", "--spin", "--insecure"}) {
    if (app.count(name) == 0) continue;
    std::string key = std::string{name}.substr(2);
    std::ranges::replace(key, '-', '_');
    if (key == "accept_links") key = "links." + key;
    const CLI::Option* option = app.get_option(name);
    const bool is_flag = option->get_items_expected_max() == 0;
    // Also --spin=false, which is stronger than what a file says.
    const std::string on = is_flag && option->as<bool>() ? "true" : "false";
    sources.flags.push_back(flag(key, name, is_flag ? on : option->results().front()));
  }
  for (const std::string& assignment : app.get_option("--limit")->results()) {
    const std::size_t equals = assignment.find('=');
    if (equals == std::string::npos) {
      return "--limit " + escaped(assignment, kQuotedMax) +
             " has no value: write NAME=VALUE, for example nodes=1000";
    }
    const std::string name = assignment.substr(0, equals);
    const std::string key = "limits." + name;
    if (std::ranges::find(sources.flags, key, &Given::key) != sources.flags.end()) {
      return "--limit " + escaped(name, kQuotedMax) + " is given twice: give it once";
    }
    sources.flags.push_back(flag(key, "--limit", assignment.substr(equals + 1)));
  }
  if (app.count("--proxy") != 0) sources.proxy = app.get_option("--proxy")->results().front();
  if (app.count("--config") != 0) sources.file = app.get_option("--config")->results().front();
  if (app.count("--config") != 0 && sources.file.empty())
    return "--config is empty: give it the path of a TOML file, or leave it out";
  return {};
}

std::string checked(const CommandLine& line) {
  std::string text;
  for (const std::string& warning : line.warnings) text += "warning: " + warning + "\n";
  text += "the configuration is right; read:";
  for (const std::string& file : line.files) text += " " + file;
  return text + (line.files.empty() ? " no file\n" : "\n");
}

std::variant<CommandLine, CommandLineEnding> read_all(const CLI::App& app, CommandLine line) {
  ReadConfiguration read = read_configuration(line.sources);
  if (!read.faults.empty()) {
    CommandLineEnding ending{2, {}};
    for (const ConfigFault& fault : read.faults) ending.text += fault.line() + "\n";
    return ending;
  }
  // Read again it is the same file, or an error: a hub does not lose its configuration because a
  // file went.
  line.sources.file = read.file;
  line.configuration = std::move(read.configuration);
  line.files = std::move(read.files);
  if (is_on(app, "--check-config")) return CommandLineEnding{0, checked(line)};
  if (is_on(app, "--print-config")) return CommandLineEnding{0, print(line.configuration)};
  return line;
}

}  // namespace

std::variant<CommandLine, CommandLineEnding> parse_command_line(int argc, const char* const* argv,
                                                                const char* const* environment) {
  CLI::App app{"tcphub carries messages between the nodes of a GIMnet.", "tcphub"};
  declare(app);
  const std::span words(argv, static_cast<std::size_t>(argc));
  if (const std::string word = wrong_word(app, words.subspan(words.empty() ? 0 : 1)); !word.empty())
    return wrong(word);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return wrong(syntax_error(app, error));
  }
  if (is_on(app, "--help")) return CommandLineEnding{0, app.help()};
  if (const std::string fault = leftover_fault(app.remaining()); !fault.empty())
    return wrong(fault);
  if (is_on(app, "--version"))
    return CommandLineEnding{0, std::string{"tcphub "} + kVersion + "\n"};
  if (is_on(app, "--help-limits")) return CommandLineEnding{0, help_limits()};
  CommandLine line;
  if (const std::string error = read_flags(app, line.sources); !error.empty()) return wrong(error);
  line.warnings = read_environment(line.sources, environment);
  return read_all(app, std::move(line));
}

}  // namespace gimnet::hub
