#include "proto/control/pattern.hpp"

#include <bit>

namespace gimnet::proto {

std::optional<Pattern> Pattern::parse(std::string_view text) {
  if (!valid_pattern(text)) return std::nullopt;
  Pattern pattern;
  pattern.text_ = text;
  std::size_t begin = 0;
  for (;;) {
    const std::size_t end = std::min(text.find('/', begin), text.size());
    const std::string_view part = text.substr(begin, end - begin);
    const States bit = 1u << pattern.count_;
    if (part == "*") pattern.stars_ |= bit;
    if (part == "**") pattern.many_ |= bit;
    if (pattern.is_name()) pattern.beginning_ = static_cast<std::uint8_t>(end);
    pattern.parts_[pattern.count_++] = {static_cast<std::uint8_t>(begin),
                                        static_cast<std::uint8_t>(part.size())};
    if (end == text.size()) return pattern;
    begin = end + 1;
  }
}

bool Pattern::matches(std::string_view name) const {
  if (is_name()) return name == text_;
  if (!name.starts_with(beginning())) return false;
  States states = skip_many(1u);
  while (states != 0) {
    const std::size_t slash = name.find('/');
    states = step(states, name.substr(0, slash));
    if (slash == std::string_view::npos) break;
    name.remove_prefix(slash + 1);
  }
  return ((states >> count_) & 1u) != 0;
}

/// `**` may also stand for no part at all.
Pattern::States Pattern::skip_many(States states) const {
  for (std::size_t i = 0; i < count_; ++i) states |= (states & many_ & (1u << i)) << 1;
  return states;
}

Pattern::States Pattern::step(States states, std::string_view name_part) const {
  States next = states & many_;
  for (States left = states & ~many_ & ((1u << count_) - 1); left != 0; left &= left - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(left));
    if (((stars_ >> i) & 1u) != 0 || part(i) == name_part) next |= 1u << (i + 1);
  }
  return skip_many(next);
}

}  // namespace gimnet::proto
