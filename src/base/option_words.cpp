#include "base/option_words.hpp"

#include "base/log.hpp"

namespace gimnet {
namespace {

std::string fault_of(const std::string& name, std::string_view value, Takes takes) {
  if (takes == Takes::nothing)
    return name + " takes no value: write " + name + " alone, or leave it out";
  if (takes == Takes::value)
    return value.empty() ? name + " is empty: give it a value, or leave it out" : "";
  if (takes == Takes::unknown || value == "true" || value == "false") return {};
  return name + " cannot be '" + escaped(value, kQuotedMax) + "': write " + name + " alone, " +
         name + "=true or " + name + "=false";
}

/// Mostly its own value was forgotten, or a shell variable in its place is not set.
bool looks_like_option(std::string_view word, const std::function<Takes(std::string_view)>& takes) {
  if (word.starts_with("--")) return true;
  return word.starts_with('-') && takes(word.substr(0, word.find('='))) != Takes::unknown;
}

}  // namespace

std::string wrong_option_word(std::span<const char* const> words,
                              const std::function<Takes(std::string_view)>& takes) {
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string_view word = words[i];
    if (word == "--") break;
    if (!word.starts_with('-')) continue;
    const std::size_t equals = word.find('=');
    const Takes what = takes(word.substr(0, equals));
    if (equals == std::string_view::npos) {
      if (what != Takes::value) continue;
      ++i;  // over its value
      if (i == words.size() || !looks_like_option(words[i], takes)) continue;
      const std::string value = escaped(words[i], kQuotedMax);
      std::string sentence(word);
      sentence +=
          " needs a value, and '" + value + "' looks like an option; if it is meant, write ";
      sentence.append(word).append(word.starts_with("--") ? "=" : "");
      return sentence + value;
    }
    std::string fault =
        fault_of(std::string(word.substr(0, equals)), word.substr(equals + 1), what);
    if (!fault.empty()) return fault;
  }
  return {};
}

}  // namespace gimnet
