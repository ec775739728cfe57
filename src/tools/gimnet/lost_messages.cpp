#include "tools/gimnet/lost_messages.hpp"

#include <string_view>

namespace gimnet::tool {
namespace {

void add_sentence(std::vector<std::string>& sentences, std::uint64_t count, std::uint64_t told, std::string_view why) {
  if (count == told) return;
  sentences.push_back(std::to_string(count) + (count == 1 ? " message was lost: " : " messages were lost: ") +
                      std::string(why));
}

}  // namespace

std::vector<std::string> LostMessages::news(std::int64_t now_ns) {
  if (all() == told_.all() || !pace_.due(now_ns)) return {};
  return rest();
}

std::vector<std::string> LostMessages::rest() {
  std::vector<std::string> sentences;
  add_sentence(sentences, counts_.incomplete, told_.incomplete, "a part did not come, or did not fit the others");
  add_sentence(sentences, counts_.too_large, told_.too_large, "larger than this end takes");
  add_sentence(sentences, counts_.broken_off, told_.broken_off,
               "on their way when the connection broke, counted in frames");
  told_ = counts_;
  return sentences;
}

}  // namespace gimnet::tool
