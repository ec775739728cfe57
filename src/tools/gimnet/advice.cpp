#include "tools/gimnet/advice.hpp"

#include <array>

namespace gimnet::tool {
namespace {

/// Advice of the library, and the same for the tool: words, the command, and words behind it.
struct Advice {
  std::string_view call;
  std::string_view before;
  std::string_view command;
  std::string_view behind;
};

constexpr std::array<Advice, 5> kAdvice{{
    {"ask it by request()", "use ", "request", ""},
    {"subscribe to it", "use ", "echo", ""},
    {"send to it", "use ", "send", ""},
    {"watch() tells", "", "watch", " tells"},
    {"find() gives the node of a name", "", "nodes", " lists nodes by name"},
}};

}  // namespace

std::string in_commands(std::string sentence, std::string_view target) {
  for (const Advice& advice : kAdvice) {
    const std::size_t at = sentence.find(advice.call);
    if (at == std::string::npos) continue;
    std::string words = std::string(advice.before) + "`gimnet " + std::string(advice.command);
    if (!target.empty()) words += " " + std::string(target);
    sentence.replace(at, advice.call.size(), words + "`" + std::string(advice.behind));
  }
  return sentence;
}

}  // namespace gimnet::tool
