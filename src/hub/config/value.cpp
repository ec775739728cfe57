#include "hub/config/value.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "base/log.hpp"
#include "base/suggest.hpp"

namespace gimnet::hub {
namespace {

using Kind = ConfigValue::Kind;

/// The key as it is written below the header of its table.
std::string own_name(const std::string& label) {
  return label.substr(label.find_last_of('.') + 1);  // npos + 1 is 0
}

}  // namespace

ConfigFault value_fault(const Given& given, std::string sentence) {
  return {given.value.place, std::move(sentence)};
}

std::string_view kind_name(Kind kind) {
  constexpr std::array<std::string_view, 8> kNames{"words",         "a text",     "a whole number",
                                                   "true or false", "a fraction", "a date or time",
                                                   "a list",        "a table"};
  return kNames[static_cast<std::size_t>(kind)];
}

bool has_kind(const Given& given, Kind wanted, const std::string& example, Faults& faults) {
  if (given.value.kind == wanted || given.value.kind == Kind::words) return true;
  faults.push_back(value_fault(given, given.label + " is " + std::string{kind_name(wanted)} +
                                          ", not " + std::string{kind_name(given.value.kind)} +
                                          ": write " + example));
  return false;
}

std::uint64_t nearest_number(const ConfigValue& value, std::uint64_t least, std::uint64_t most,
                             std::uint64_t usual) {
  if (value.kind != Kind::text && value.kind != Kind::fraction) return usual;
  double number = 0.0;
  const char* const last = value.text.data() + value.text.size();
  const auto [end, error] = std::from_chars(value.text.data(), last, number);
  if (error != std::errc{} || end != last || !std::isfinite(number)) return usual;
  if (number <= static_cast<double>(least)) return least;
  if (number >= static_cast<double>(most)) return most;
  return static_cast<std::uint64_t>(std::llround(number));
}

std::optional<std::size_t> number_in(const Given& given, std::size_t least, std::size_t most,
                                     Faults& faults) {
  const std::uint64_t instead = nearest_number(given.value, least, most, least);
  if (!has_kind(given, Kind::integer, own_name(given.label) + " = " + std::to_string(instead),
                faults))
    return std::nullopt;
  const std::string& text = given.value.text;
  std::size_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc{} && end == text.data() + text.size() && value >= least && value <= most)
    return value;
  faults.push_back(value_fault(given, given.label + " cannot be '" + escaped(text, kQuotedMax) +
                                          "': give a whole number from " + std::to_string(least) +
                                          " to " + std::to_string(most)));
  return std::nullopt;
}

bool one_of(const Given& given, std::span<const std::string_view> words, const std::string& list,
            Faults& faults) {
  if (!has_kind(given, Kind::text, given.label + " = \"" + std::string{words.front()} + "\"",
                faults))
    return false;
  if (std::ranges::find(words, given.value.text) != words.end()) return true;
  faults.push_back(value_fault(given, given.label + " cannot be '" +
                                          escaped(given.value.text, kQuotedMax) + "': " + list +
                                          did_you_mean(given.value.text, words)));
  return false;
}

std::optional<bool> true_or_false(const Given& given, Faults& faults) {
  if (!has_kind(given, Kind::boolean, own_name(given.label) + " = true", faults))
    return std::nullopt;
  if (given.value.text == "true" || given.value.text == "false") return given.value.text == "true";
  faults.push_back(value_fault(given, given.label + " cannot be '" +
                                          escaped(given.value.text, kQuotedMax) +
                                          "': write true or false"));
  return std::nullopt;
}

}  // namespace gimnet::hub
