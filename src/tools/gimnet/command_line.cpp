#include "tools/gimnet/command_line.hpp"

#include <CLI/CLI.hpp>
#include <array>
#include <span>
#include <string_view>
#include <vector>

#include "base/suggest.hpp"
#include "tools/gimnet/command_help.hpp"
#include "tools/gimnet/command_options.hpp"

namespace gimnet::tool {
namespace {

/// The first word that is neither an option nor the value of one that stands before commands.
std::string_view command_word(std::span<const char* const> arguments) {
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string_view word = arguments[i];
    if (word == "--hub" || word == "--shard" || word == "--color") {
      ++i;
    } else if (!word.starts_with('-')) {
      return word;
    }
  }
  return {};
}

/// `command`: "" or the command's word.
CommandLineEnding wrong(const std::string& sentence, std::string_view command) {
  const std::string called = command.empty() ? "gimnet" : "gimnet " + std::string(command);
  return {ExitCode::usage, "gimnet: " + sentence + "\n`" + called + " --help` shows how it is called.\n"};
}

std::variant<Options, CommandLineEnding> unknown_command(std::string_view word) {
  std::array<std::string_view, kCommands.size()> names;
  for (std::size_t i = 0; i < names.size(); ++i) names[i] = kCommands[i].first;
  return wrong("there is no command '" + std::string(word) + "'" + did_you_mean(word, names), "");
}

/// What CLI11 cannot know.
std::string contradiction(const Options& options) {
  if (options.json && options.raw) return "--json and --raw contradict each other: give one of them";
  const bool names_service = options.command == Command::pub || options.command == Command::echo ||
                             options.command == Command::hz || options.command == Command::bw;
  if (names_service && options.target.find_first_of("/*") == std::string::npos) {
    return "'" + options.target + "' is no full name of a service: write NODE/SERVICE";
  }
  if (options.command == Command::pub) {
    const auto slash = options.target.rfind('/');
    if (slash == std::string::npos || slash == 0 || slash + 1 == options.target.size()) {
      return "'" + options.target + "' is no full name of a service: write NODE/SERVICE";
    }
    const std::string node = options.target.substr(0, slash);
    if (!options.name.empty() && options.name != node) {
      return "the service " + options.target + " belongs to the node " + node + ", not to " + options.name +
             ": leave --name out";
    }
  }
  return {};
}

/// The options that can be given, those of the command first.
std::vector<const CLI::Option*> options_of(const CLI::App& app, std::string_view command) {
  std::vector<const CLI::Option*> all;
  if (!command.empty()) {
    for (const CLI::Option* option : app.get_subcommand_ptr(std::string(command))->get_options()) all.push_back(option);
  }
  for (const CLI::Option* option : app.get_options()) all.push_back(option);
  return all;
}

/// A word that nothing takes.
std::string unexpected(const std::string& word, const std::vector<const CLI::Option*>& options,
                       std::string_view command) {
  const std::string called = command.empty() ? "gimnet" : "gimnet " + std::string(command);
  if (!word.starts_with('-')) return "'" + word + "' is one word too many for " + called;
  const std::string given = word.substr(0, word.find('='));
  std::vector<std::string> names;
  for (const CLI::Option* option : options) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  const std::vector<std::string_view> views(names.begin(), names.end());
  return "there is no option " + given + " for " + called + did_you_mean(given, views);
}

/// What CLI11 says, in words that name the option, what was given and what it takes.
std::string explained(const CLI::ParseError& error, const std::vector<const CLI::Option*>& options) {
  const std::string said = error.what();
  const CLI::Option* concerned = nullptr;
  std::size_t longest = 0;
  for (const CLI::Option* option : options) {
    const std::string name = option->get_name();
    if (name.size() <= longest || said.find(name) == std::string::npos) continue;
    concerned = option;
    longest = name.size();
  }
  if (concerned == nullptr) return said;
  const std::string name = concerned->get_name(false, true);
  const std::string& takes = concerned->get_description();
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr) return name + " is missing: " + takes;
  const auto given = concerned->results();
  if (given.empty() || given.back().empty()) return name + " needs a value: " + takes;
  return "'" + given.back() + "' is no value for " + name + ": " + takes;
}

}  // namespace

std::variant<Options, CommandLineEnding> parse_command_line(int argc, const char* const* argv) {
  Options options;
  CLI::App app(help::kAbout, "gimnet");
  add_commands(app, options);
  const std::span arguments(argv, static_cast<std::size_t>(argc));
  const std::string_view word = command_word(arguments.subspan(arguments.empty() ? 0 : 1));
  const auto* known = kCommands.begin();
  while (known != kCommands.end() && known->first != word) ++known;
  if (!word.empty() && known == kCommands.end()) return unknown_command(word);
  std::string sentence;
  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    return CommandLineEnding{ExitCode::done, app.help()};
  } catch (const CLI::CallForVersion& version) {
    return CommandLineEnding{ExitCode::done, std::string(version.what()) + "\n"};
  } catch (const CLI::ParseError& error) {
    sentence = explained(error, options_of(app, word));
  }
  if (const auto extras = app.remaining(true); !extras.empty()) {
    return wrong(unexpected(extras.front(), options_of(app, word), word), word);
  }
  if (!sentence.empty()) return wrong(sentence, word);
  if (word.empty()) return CommandLineEnding{ExitCode::usage, app.help()};
  options.command = known->second;
  if (sentence = contradiction(options); !sentence.empty()) return wrong(sentence, word);
  return options;
}

}  // namespace gimnet::tool
