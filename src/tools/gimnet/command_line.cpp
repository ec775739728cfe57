#include "tools/gimnet/command_line.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "base/suggest.hpp"
#include "tools/gimnet/command_options.hpp"

namespace gimnet::tool {
namespace {

/// Words behind it are no options, whatever they begin with: the names of nodes may begin so.
constexpr std::string_view kEndOfOptions = "--";

/// The command that the words call and, of `ctl`, the action. "": it is missing.
struct Called {
  std::string_view command;
  std::string_view action;
  [[nodiscard]] std::string text() const {
    std::string text = "gimnet";
    for (const std::string_view word : {command, action})
      text += word.empty() ? "" : " " + std::string(word);
    return text;
  }
};

/// The first words that are neither options nor the values of those that stand anywhere.
Called called_by(std::span<const char* const> arguments) {
  Called called;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string_view word = arguments[i];
    if (word == "--hub" || word == "--proxy" || word == "--shard" || word == "--color") {
      ++i;
    } else if (word.starts_with('-')) {
      continue;
    } else if (called.command.empty()) {
      called.command = word;
      if (word != "ctl") break;
    } else {
      called.action = word;
      break;
    }
  }
  return called;
}

CommandEnding wrong(const std::string& sentence, const Called& called) {
  return {ExitCode::usage,
          "gimnet: " + sentence + "\n`" + called.text() + " --help` shows how it is called.\n"};
}

/// Commands of the tools of other networks, and ours that does the same; "" if none is
/// known.
std::string_view command_meant(std::string_view word) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 9> kWords{{
      {"sub", "echo"},
      {"subscribe", "echo"},
      {"publish", "pub"},
      {"topic", "services"},
      {"topics", "services"},
      {"list", "services"},
      {"node", "nodes"},
      {"info", "services"},
      {"monitor", "watch"},
  }};
  for (const auto& [theirs, ours] : kWords) {
    if (word == theirs) return ours;
  }
  return {};
}

CommandEnding unknown_command(std::string_view word) {
  if (const std::string_view meant = command_meant(word); !meant.empty()) {
    return wrong(
        "there is no command '" + std::string(word) + "'; did you mean " + std::string(meant) + "?",
        {});
  }
  std::array<std::string_view, kCommands.size()> names;
  for (std::size_t i = 0; i < names.size(); ++i) names[i] = kCommands[i].first;
  // Other tools have this as a command.
  const bool is_option = word == "version";
  const std::string nearest =
      is_option ? "; did you mean --" + std::string(word) + "?" : did_you_mean(word, names);
  return wrong("there is no command '" + std::string(word) + "'" + nearest, {});
}

/// A word before the command that looks like an option and is none, whose value was taken for the
/// command; "" if there is no such word. REQUIRES: `command` is one of the arguments.
std::string_view stranger_before(std::string_view command, std::span<const char* const> arguments,
                                 const CLI::App& app) {
  for (const char* const argument : arguments) {
    if (argument == command.data()) break;
    const std::string_view word = argument;
    if (!word.starts_with('-') || word == kEndOfOptions) continue;
    if (app.get_option_no_throw(std::string(word.substr(0, word.find('=')))) == nullptr)
      return word;
  }
  return {};
}

/// A line each: the whole help is longer than a screen.
CommandEnding missing_command(const CLI::App& app) {
  constexpr std::size_t kColumn = 10;
  std::string text = "gimnet: the command is missing; these are there:\n";
  for (const auto& [word, command] : kCommands) {
    const std::string about = app.get_subcommand(std::string(word))->get_description();
    text += "  " + std::string(word) + std::string(kColumn - word.size(), ' ') +
            about.substr(0, about.find('\n')) + "\n";
  }
  text += "`gimnet --help` shows examples and options, `gimnet COMMAND --help` those of one.\n";
  return {ExitCode::usage, text};
}

std::string all_actions() {
  std::string names;
  for (const std::string_view action : kCtlActions) {
    names += (names.empty()                  ? ""
              : action == kCtlActions.back() ? " or "
                                             : ", ") +
             std::string(action);
  }
  return names;
}

CommandEnding unknown_action(std::string_view word) {
  const bool is_command =
      std::ranges::find(kCommands, word, &decltype(kCommands)::value_type::first) !=
      kCommands.end();
  const std::string nearest = is_command ? "; that is a command: gimnet " + std::string(word)
                                         : did_you_mean(word, kCtlActions);
  return wrong("there is no action '" + std::string(word) + "' of gimnet ctl" +
                   (nearest.empty() ? ": give " + all_actions() : nearest),
               {"ctl", ""});
}

CommandEnding missing_action() { return wrong("action is missing: " + all_actions(), {"ctl", ""}); }

/// A pattern where one node is meant.
std::string too_many(const ToolOptions& options, const Called& called) {
  const bool acts = options.command == Command::ctl;
  const std::string& word = acts ? options.ctl.node : options.target;
  const bool names_node = acts || options.command == Command::ping ||
                          options.command == Command::send || options.command == Command::routes ||
                          options.command == Command::trace;
  if (!names_node || !is_pattern(word)) return {};
  return "'" + word + "' is a pattern, and " + called.text() + " takes one node: `gimnet nodes '" +
         word + "'` lists those that match";
}

/// A contradiction that CLI11 cannot know.
std::string contradiction(const ToolOptions& options) {
  if (options.json && options.raw)
    return "--json and --raw contradict each other: give one of them";
  if (!options.text.empty() && !options.file.empty())
    return "a text and --file contradict each other: give one of them";
  if (options.ascii + options.dot + options.json > 1 && options.command == Command::graph)
    return "--ascii, --dot and --json contradict each other: give one of them";
  if (options.command == Command::status && options.all && options.hub_id != 0)
    return "--all and --hub-id contradict each other: give one of them";
  if (options.command == Command::ctl) {
    if (std::string wrong = link_fault(options.ctl); !wrong.empty()) return wrong;
  }
  if (options.command != Command::ctl && options.target.find_first_of("#+>") != std::string::npos) {
    return "'" + options.target +
           "' has a character that no name has; in patterns `*` is one part, `**` any number";
  }
  const bool names_service = options.command == Command::pub || options.command == Command::echo ||
                             options.command == Command::hz || options.command == Command::bw ||
                             options.command == Command::request ||
                             options.command == Command::answer;
  if (names_service && options.target.find_first_of("/*") == std::string::npos) {
    return "'" + options.target + "' is no full name of a service: write NODE/SERVICE";
  }
  const bool is_one_part = options.target.find('/') == std::string::npos;
  if (names_service && options.command != Command::pub && is_one_part &&
      options.target.find("**") == std::string::npos) {
    return "'" + options.target +
           "' matches no service: full names are NODE/SERVICE, so write NODE/*, or ** for all";
  }
  const bool names_one = options.command == Command::request || options.command == Command::answer;
  if (names_one && is_pattern(options.target))
    return "'" + options.target + "' is a pattern: name one service, NODE/SERVICE";
  if (options.command == Command::pub || names_one) {
    const auto slash = options.target.rfind('/');
    if (slash == std::string::npos || slash == 0 || slash + 1 == options.target.size()) {
      return "'" + options.target + "' is no full name of a service: write NODE/SERVICE";
    }
    const std::string node = options.target.substr(0, slash);
    if (!options.name.empty() && options.name != node) {
      return "the service " + options.target + " belongs to the node " + node + ", not to " +
             options.name + ": leave --name out";
    }
  }
  return {};
}

/// The options that can be given, those of the command first. REQUIRES: what is called is there.
std::vector<const CLI::Option*> options_of(const CLI::App& app, const Called& called) {
  std::vector<const CLI::Option*> all;
  const auto add = [&all](const CLI::App& of) {
    for (const CLI::Option* option : of.get_options()) all.push_back(option);
  };
  if (!called.command.empty()) {
    const CLI::App& command = *app.get_subcommand(std::string(called.command));
    if (!called.action.empty()) add(*command.get_subcommand(std::string(called.action)));
    add(command);
  }
  add(app);
  return all;
}

/// The first word that CLI11 left over, and whether it stands behind the end of options, which it
/// leaves over, too.
struct LeftOver {
  std::string word;
  bool behind_end = false;
};
std::optional<LeftOver> left_over(std::vector<std::string> extras,
                                  std::span<const char* const> arguments) {
  const auto end = std::ranges::find(arguments, kEndOfOptions,
                                     [](const char* word) { return std::string_view(word); });
  if (end != arguments.end()) {
    const auto mark = std::ranges::find(extras, kEndOfOptions);
    if (mark != extras.end()) extras.erase(mark);
  }
  if (extras.empty()) return std::nullopt;
  const bool before = std::find(arguments.begin(), end, extras.front()) != end;
  return LeftOver{extras.front(), !before};
}

/// A word that nothing takes.
std::string unexpected(const LeftOver& left, const std::vector<const CLI::Option*>& options,
                       const Called& called) {
  const std::string& word = left.word;
  if (left.behind_end || !word.starts_with('-')) {
    const bool reads_lines = called.command == "send" || called.command == "pub";
    const std::string advice = called.command == "recv" ? "; did you mean --name " + word + "?"
                               : reads_lines ? ": messages are lines of its standard input"
                               : called.command == "request"
                                   ? ": put a text of several words in quotes"
                                   : "";
    return "'" + word + "' is one word too many for " + called.text() + advice;
  }
  const std::string given = word.substr(0, word.find('='));
  std::vector<std::string> names;
  for (const CLI::Option* option : options) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  const std::vector<std::string_view> views(names.begin(), names.end());
  return "there is no option " + given + " for " + called.text() + did_you_mean(given, views);
}

/// A word that CLI11 would take for something else; "": none.
std::string wrong_word(std::span<const char* const> words,
                       const std::vector<const CLI::Option*>& options) {
  return wrong_option_word(words, [&options](std::string_view name) {
    const auto found = std::ranges::find_if(
        options, [&](const CLI::Option* option) { return option->check_name(std::string(name)); });
    if (found == options.end()) return Takes::unknown;
    if ((*found)->get_items_expected_max() != 0) return Takes::value;
    return name == "--help" || name == "--version" ? Takes::nothing : Takes::boolean;
  });
}

/// The error of CLI11, in words that name the option, what was given and what it takes.
std::string explained(const CLI::ParseError& error,
                      const std::vector<const CLI::Option*>& options) {
  std::string said = error.what();
  const CLI::Option* concerned = nullptr;
  std::size_t longest = 0;
  for (const CLI::Option* option : options) {
    const std::string name = option->get_name();
    if (name.size() <= longest || said.find(name) == std::string::npos) continue;
    concerned = option;
    longest = name.size();
  }
  // One that the help does not show has no name for CLI11, which then begins with what would be
  // behind it.
  const bool hidden = concerned == nullptr && said.starts_with(':');
  if (hidden) {
    const auto found = std::ranges::find_if(
        options, [](const CLI::Option* option) { return option->get_group().empty(); });
    if (found != options.end()) concerned = *found;
  }
  if (concerned == nullptr) return said;
  const std::string name =
      hidden ? "--" + concerned->get_lnames().front() : concerned->get_name(false, true);
  const std::string& takes = concerned->get_description();
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr)
    return name + " is missing: " + takes;
  const auto given = concerned->results();
  if (given.size() > 1)
    return name + " is given " + std::to_string(given.size()) + " times: give it once";
  if (given.empty() || given.back().empty()) return name + " needs a value: " + takes;
  return "'" + given.back() + "' is no value for " + name + ": " + takes;
}

/// `gimnet help` is `gimnet --help`, and `gimnet help COMMAND` is `gimnet COMMAND --help`.
std::variant<ToolOptions, CommandEnding> help_of(std::span<const char* const> arguments,
                                                 std::string_view help) {
  std::vector<const char*> words(arguments.begin(), arguments.end());
  std::erase_if(words, [&](const char* word) { return word == help.data(); });
  if (std::ranges::find(words, std::string_view{"--help"}) == words.end())
    words.push_back("--help");
  return parse_command_line(static_cast<int>(words.size()), words.data());
}

}  // namespace

std::variant<ToolOptions, CommandEnding> parse_command_line(int argc, const char* const* argv) {
  ToolOptions options;
  CLI::App app(help::kAbout, "gimnet");
  add_commands(app, options);
  const std::span arguments(argv, static_cast<std::size_t>(argc));
  const Called called = called_by(arguments.subspan(arguments.empty() ? 0 : 1));
  if (called.command == "help") return help_of(arguments, called.command);
  const auto* known = kCommands.begin();
  while (known != kCommands.end() && known->first != called.command) ++known;
  if (!called.command.empty() && known == kCommands.end()) {
    const std::string_view stranger = stranger_before(called.command, arguments, app);
    if (stranger.empty()) return unknown_command(called.command);
    return wrong(unexpected({std::string(stranger)}, options_of(app, {}), {}), {});
  }
  const bool acts = std::ranges::find(kCtlActions, called.action) != kCtlActions.end();
  if (!called.action.empty() && !acts) return unknown_action(called.action);
  std::string sentence = wrong_word(arguments, options_of(app, called));
  if (!sentence.empty()) return wrong(sentence, called);
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    return CommandEnding{ExitCode::done, app.help()};
  } catch (const CLI::CallForVersion& version) {
    return CommandEnding{ExitCode::done, std::string(version.what()) + "\n"};
  } catch (const CLI::ParseError& error) {
    sentence = explained(error, options_of(app, called));
  }
  if (const auto left = left_over(app.remaining(true), arguments)) {
    return wrong(unexpected(*left, options_of(app, called), called), called);
  }
  if (called.command == "ctl" && !acts) return missing_action();
  if (!sentence.empty()) return wrong(sentence, called);
  if (called.command.empty()) return missing_command(app);
  options.command = known->second;
  if (sentence = too_many(options, called); !sentence.empty()) return wrong(sentence, called);
  if (sentence = contradiction(options); !sentence.empty()) return wrong(sentence, called);
  return options;
}

}  // namespace gimnet::tool
