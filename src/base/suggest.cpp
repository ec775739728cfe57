#include "base/suggest.hpp"

#include <algorithm>
#include <vector>

#include "base/log.hpp"

namespace gimnet {
namespace {

char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

/// `Same`: are two letters one?
template <class Same>
std::size_t distance_between(std::string_view a, std::string_view b, Same same) {
  // Three rows of the usual table: a swap of neighbours looks two rows back.
  std::vector<std::size_t> before(b.size() + 1);
  std::vector<std::size_t> previous(b.size() + 1);
  std::vector<std::size_t> current(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) previous[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    current[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t exchange = previous[j - 1] + (same(a[i - 1], b[j - 1]) ? 0 : 1);
      current[j] = std::min({previous[j] + 1, current[j - 1] + 1, exchange});
      const bool swapped = i > 1 && j > 1 && same(a[i - 1], b[j - 2]) && same(a[i - 2], b[j - 1]);
      if (swapped) current[j] = std::min(current[j], before[j - 2] + 1);
    }
    before.swap(previous);
    previous.swap(current);
  }
  return previous[b.size()];
}

}  // namespace

std::size_t edit_distance(std::string_view a, std::string_view b) {
  return distance_between(a, b, [](char one, char other) { return one == other; });
}

std::string did_you_mean(std::string_view word, std::span<const std::string_view> candidates) {
  std::string_view best;
  std::size_t least = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string_view candidate : candidates) {
    if (candidate == word) continue;  // it came in the meantime: what was meant is what was said
    const std::size_t longer = std::max(word.size(), candidate.size());
    if (longer - std::min(word.size(), candidate.size()) > least)
      continue;  // so many letters differ at least
    const std::size_t distance = distance_between(
        word, candidate, [](char one, char other) { return lower(one) == lower(other); });
    // Half of the letters must be right: of three letters two steps lead nearly anywhere.
    if (distance > least || 2 * distance > longer) continue;
    // Of two that are as near, the one that goes on where the word ends.
    const bool goes_on = candidate.starts_with(word) && !best.starts_with(word);
    if (distance < least || (!best.empty() && goes_on)) {
      least = distance;
      best = candidate;
    }
  }
  return best.empty() ? std::string{} : "; did you mean " + std::string{best} + "?";
}

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
