#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/bitestream/utf8.hpp"

namespace gimnet::hub {

/// A text by lines, counted from 1, each of which can be blanked without moving the others.
/// Thread safety: none. Errors: a number that is no line's is the caller's mistake.
class TomlLines {
 public:
  explicit TomlLines(std::string_view text) : text_(text) {
    if (text_.starts_with("\xEF\xBB\xBF")) text_.erase(0, 3);  // a mark of the encoding is no part of the first line
    for (std::size_t at = 0; at <= text_.size();) {
      begins_.push_back(at);
      at = std::min(text_.find('\n', at), text_.size()) + 1;
    }
    if (!text_.ends_with('\n')) text_ += '\n';
    begins_.push_back(text_.size());
  }
  [[nodiscard]] std::size_t size() const { return begins_.size() - 1; }

  /// The lines first..last as one text. Valid until: one of them changes. Empty if last < first.
  [[nodiscard]] std::string_view text(std::size_t first, std::size_t last) const {
    if (last < first) return {};
    return std::string_view{text_}.substr(begins_[first - 1], begins_[last] - begins_[first - 1]);
  }
  /// One line, without its end.
  [[nodiscard]] std::string_view line(std::size_t number) const {
    std::string_view line = text(number, number);
    if (line.ends_with('\n')) line.remove_suffix(1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    return line;
  }
  /// The line, from `number` upward and not above `first`, where a key or a table begins.
  [[nodiscard]] std::size_t beginning(std::size_t number, std::size_t first) const {
    while (number > first && !begins(line(number))) --number;
    return number;
  }
  /// Does the header of a table begin there?
  [[nodiscard]] bool is_header(std::size_t number) const { return trimmed(line(number)).starts_with('['); }
  /// Dots that may separate the parts of a key: none of those in a value behind it.
  [[nodiscard]] std::size_t key_dots(std::size_t number) const {
    const std::string_view all = line(number);
    const std::size_t end = is_header(number) ? all.size() : all.rfind('=');
    if (end == std::string_view::npos || trimmed(all).starts_with('#')) return 0;
    return static_cast<std::size_t>(std::count(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(end), '.'));
  }
  /// Blanks the lines first..last.
  void blank(std::size_t first, std::size_t last) {
    for (std::size_t at = begins_[first - 1]; at < begins_[last]; ++at) {
      if (text_[at] != '\n') text_[at] = ' ';
    }
  }
  /// The number that ends right before the column (from 1, in characters), and where it begins.
  [[nodiscard]] std::pair<std::string_view, std::size_t> number_before(std::size_t number, std::size_t column) const {
    constexpr std::string_view kNumberCharacters = "0123456789abcdefABCDEFox_+-";  // of a whole number of TOML
    const std::string_view all = line(number);
    std::size_t end = 0;
    for (std::size_t at = 1; at < column && end < all.size(); ++at) {
      end += std::max<std::size_t>(character_size(all.substr(end)), 1);
    }
    std::size_t begin = end;
    while (begin > 0 && kNumberCharacters.find(all[begin - 1]) != std::string_view::npos) --begin;
    return {all.substr(begin, end - begin), column - (end - begin)};
  }
  /// Column (from 1, in bytes) of the first character that is no blank.
  [[nodiscard]] std::size_t first_column(std::size_t number) const {
    return line(number).size() - trimmed(line(number)).size() + 1;
  }
  /// Puts a `?` in place of each byte that is no UTF-8. Column (from 1, in characters) of the first; 0: there was none.
  [[nodiscard]] std::size_t mend_text(std::size_t number) {
    const std::size_t begin = begins_[number - 1];
    const std::size_t bytes = line(number).size();
    std::size_t first = 0;
    for (std::size_t at = 0, column = 1; at < bytes; ++column) {
      const std::size_t size = character_size(line(number).substr(at));
      if (size == 0) text_[begin + at] = '?';
      if (size == 0 && first == 0) first = column;
      at += std::max<std::size_t>(size, 1);
    }
    return first;
  }

 private:
  /// Bytes of the first character; 0: it is none.
  static std::size_t character_size(std::string_view text) {
    const auto* bytes = reinterpret_cast<const unsigned char*>(text.data());
    for (std::size_t size = 1; size <= std::min<std::size_t>(4, text.size()); ++size) {
      if (proto::bitestream::valid_utf8(bytes, size)) return size;
    }
    return 0;
  }
  static std::string_view trimmed(std::string_view line) {
    const std::size_t first = line.find_first_not_of(" \t");
    return first == std::string_view::npos ? std::string_view{} : line.substr(first);
  }
  static bool begins(std::string_view line) {
    line = trimmed(line);
    return line.starts_with('[') || (line.find('=') != std::string_view::npos && !line.starts_with('#'));
  }

  std::string text_;                 ///< each line with its end
  std::vector<std::size_t> begins_;  ///< of each line, and behind the last
};

}  // namespace gimnet::hub
