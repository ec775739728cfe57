#include "tools/gimnet/advice.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <regex>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

namespace gimnet::tool {
namespace {

TEST(Advice, NamesTheCommandThatDoesWhatTheCallDoes) {
  EXPECT_EQ(in_commands("cannot send to 'a/b': it answers questions; ask it by request()", "a/b"),
            "cannot send to 'a/b': it answers questions; use `gimnet request a/b`");
  EXPECT_EQ(in_commands("a/b takes data and gives none; send to it; going on without it", ""),
            "a/b takes data and gives none; use `gimnet send`; going on without it");
  EXPECT_EQ(in_commands("there is no such service; watch() tells when there is", "a/b"),
            "there is no such service; `gimnet watch a/b` tells when there is");
  EXPECT_EQ(in_commands("the hub is away", "a/b"), "the hub is away");
}

/// The sources of the library that have sentences.
std::vector<std::filesystem::path> sources() {
  std::vector<std::filesystem::path> found;
  for (const std::string_view folder : {"client", "proto/control"}) {
    const auto root = std::filesystem::path(GIMNET_SOURCES) / folder;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
      const auto extension = entry.path().extension();
      // Headers of the protocol speak to the compiler alone.
      if (extension == ".cpp" || (extension == ".hpp" && folder == "client"))
        found.push_back(entry.path());
    }
  }
  return found;
}

/// The texts of a source: its literals without comments, neighbours joined as the compiler does.
std::vector<std::string> texts_of(const std::filesystem::path& path) {
  std::ostringstream all;
  all << std::ifstream(path).rdbuf();
  const std::string source = std::regex_replace(all.str(), std::regex("//[^\n]*"), "");
  static const std::regex literals(R"re("(?:[^"\\\n]|\\.)*"(?:\s*"(?:[^"\\\n]|\\.)*")*)re");
  static const std::regex seam(R"re("\s*")re");
  std::vector<std::string> texts;
  for (std::sregex_iterator i(source.begin(), source.end(), literals), end; i != end; ++i)
    texts.push_back(std::regex_replace(i->str(), seam, ""));
  return texts;
}

/// Calls in sentences that the tool never causes: of the operating system, of an Executor's
/// callback, and of mistakes with the C functions.
bool is_of_programs(const std::string& sentence) {
  constexpr std::array<std::string_view, 4> kCalls{"fork()", "request_later()", "\"gimi_", "nif_"};
  return std::ranges::any_of(
      kCalls, [&](std::string_view call) { return sentence.find(call) != std::string::npos; });
}

TEST(Advice, HoldsForEachSentenceOfTheLibraryThatNamesACall) {
  static const std::regex call(R"re(\b[a-z_]+\(\))re");
  std::size_t translated = 0;
  for (const std::filesystem::path& source : sources()) {
    for (const std::string& text : texts_of(source)) {
      if (!std::regex_search(text, call) || is_of_programs(text)) continue;
      ++translated;
      EXPECT_FALSE(std::regex_search(in_commands(text, "a/b"), call))
          << "src/tools/gimnet/advice.cpp has no command for " << text << " of " << source;
    }
  }
  EXPECT_GE(translated, 5u) << "the sentences are found";
}

}  // namespace
}  // namespace gimnet::tool
