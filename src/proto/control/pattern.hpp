#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "proto/control/names.hpp"

namespace gimnet::proto {

/// A pattern that was taken apart once and is compared with many names.
/// Thread safety: immutable. Cost of matches(): one comparison of the beginning for most names that
/// do not fit, else at most 16 x 16 comparisons of parts, whatever the pattern.
class Pattern {
 public:
  /// Nothing: it is not a pattern.
  [[nodiscard]] static std::optional<Pattern> parse(std::string_view text);

  /// REQUIRES: valid_name(name).
  [[nodiscard]] bool matches(std::string_view name) const;

  [[nodiscard]] const std::string& text() const { return text_; }
  /// Every name that fits begins with this: all up to the first part with a `*`, without the '/'
  /// before it.
  [[nodiscard]] std::string_view beginning() const {
    return std::string_view{text_}.substr(0, beginning_);
  }
  /// Has it no `*`? Then it fits one name.
  [[nodiscard]] bool is_name() const { return (stars_ | many_) == 0; }

 private:
  /// Bit i: the name's parts so far fit the pattern's first i parts.
  using States = std::uint32_t;
  [[nodiscard]] std::string_view part(std::size_t index) const {
    return std::string_view{text_}.substr(parts_[index].begin, parts_[index].size);
  }
  [[nodiscard]] States skip_many(States states) const;
  [[nodiscard]] States step(States states, std::string_view name_part) const;

  struct Part {
    std::uint8_t begin = 0;
    std::uint8_t size = 0;
  };
  std::string text_;
  std::array<Part, kNamePartsMax> parts_{};
  std::uint8_t count_ = 0;
  std::uint8_t beginning_ = 0;
  States stars_ = 0;  ///< bit i: part i is `*`
  States many_ = 0;   ///< bit i: part i is `**`
};

}  // namespace gimnet::proto
