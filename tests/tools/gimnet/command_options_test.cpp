#include "tools/gimnet/command_options.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <variant>
#include <vector>

#include "tools/gimnet/command_line.hpp"

namespace gimnet::tool {
namespace {

/// The output of `gimnet WORDS --help`.
std::string help(const std::vector<std::string>& words) {
  std::vector<const char*> arguments{"gimnet"};
  for (const std::string& word : words) arguments.push_back(word.c_str());
  arguments.push_back("--help");
  const auto parsed = parse_command_line(static_cast<int>(arguments.size()), arguments.data());
  const auto* ending = std::get_if<CommandEnding>(&parsed);
  if (ending == nullptr || ending->code != ExitCode::done) return "no help";
  return ending->text;
}

std::size_t count(const std::string& text, const std::string& part) {
  std::size_t found = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
    ++found;
  return found;
}

/// Everything that can be called.
std::vector<std::vector<std::string>> all_calls() {
  std::vector<std::vector<std::string>> calls{{}};
  for (const auto& [word, command] : kCommands) calls.push_back({std::string(word)});
  for (const std::string_view action : kCtlActions) calls.push_back({"ctl", std::string(action)});
  return calls;
}

TEST(HelpFormat, EverythingThatCanBeCalledHasAnExample) {
  for (const auto& words : all_calls()) {
    const std::string text = help(words);
    std::string called = "gimnet";
    for (const std::string& word : words) called += " " + word;
    EXPECT_NE(text.find("Usage: " + called), std::string::npos) << text;
    EXPECT_EQ(count(text, "Examples:"), 1u) << "its own, not those of its parts: " << text;
    const std::string examples = text.substr(0, text.find("Usage: "));
    const bool shown = std::ranges::all_of(
        words, [&](const std::string& word) { return examples.find(word) != std::string::npos; });
    EXPECT_TRUE(shown) << examples;
  }
}

TEST(HelpFormat, SaysRangesInWordsOnly) {
  for (const auto& words : all_calls()) {
    const std::string text = help(words);
    for (const char* noise : {"UINT", "FLOAT", "TEXT", "ENUM", " in [", "REQUIRED"}) {
      EXPECT_EQ(text.find(noise), std::string::npos) << text;
    }
  }
  const std::string recv = help({"recv"});
  EXPECT_NE(recv.find("--name WORD (required) "), std::string::npos) << recv;
  EXPECT_NE(recv.find("-n,--count N "), std::string::npos) << recv;
  EXPECT_NE(recv.find("--seconds X "), std::string::npos) << recv;
  EXPECT_NE(recv.find("--raw  "), std::string::npos) << recv;
}

TEST(HelpFormat, ListsCommandsInALineEach) {
  const std::string text = help({});
  const std::string list = text.substr(text.find("Subcommands:"));
  EXPECT_EQ(static_cast<std::size_t>(std::ranges::count(list, '\n')), kCommands.size() + 2) << list;
  for (const auto& [word, command] : kCommands)
    EXPECT_NE(list.find("  " + std::string(word) + " "), std::string::npos);
}

TEST(HelpFormat, TellsWhatStandsWithEveryCommand) {
  for (const auto& words : all_calls()) {
    if (words.empty()) continue;
    EXPECT_NE(help(words).find("With every command: --hub URL"), std::string::npos);
  }
}

}  // namespace
}  // namespace gimnet::tool
