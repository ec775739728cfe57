#include "base/option_words.hpp"

#include "base/log.hpp"

namespace gimnet {
namespace {

std::string fault_of(const std::string& name, std::string_view value, Takes takes) {
  if (takes == Takes::nothing) return name + " takes no value: write " + name + " alone, or leave it out";
  if (takes == Takes::value) return value.empty() ? name + " is empty: give it a value, or leave it out" : "";
  if (takes == Takes::unknown || value == "true" || value == "false") return {};
  return name + " cannot be '" + escaped(value, kQuotedMax) + "': write " + name + " alone, " + name + "=true or " +
         name + "=false";
}

}  // namespace

std::string wrong_option_word(std::span<const char* const> words, const std::function<Takes(std::string_view)>& takes) {
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string_view word = words[i];
    if (word == "--") break;
    if (!word.starts_with('-')) continue;
    const std::size_t equals = word.find('=');
    const Takes what = takes(word.substr(0, equals));
    if (equals == std::string_view::npos) {
      if (what == Takes::value) ++i;  // whatever it looks like
      continue;
    }
    std::string fault = fault_of(std::string(word.substr(0, equals)), word.substr(equals + 1), what);
    if (!fault.empty()) return fault;
  }
  return {};
}

}  // namespace gimnet
