#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
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
    if (text_.starts_with("\xEF\xBB\xBF"))
      text_.erase(0, 3);  // a mark of the encoding is no part of the first line
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
  [[nodiscard]] bool is_header(std::size_t number) const {
    return trimmed(line(number)).starts_with('[');
  }
  /// Dots that may separate the parts of a key: none of those in a value behind it.
  [[nodiscard]] std::size_t key_dots(std::size_t number) const {
    const std::string_view all = line(number);
    const std::size_t end = is_header(number) ? all.size() : all.rfind('=');
    if (end == std::string_view::npos || trimmed(all).starts_with('#')) return 0;
    return static_cast<std::size_t>(
        std::count(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(end), '.'));
  }
  /// Where the text over several lines begins in which the lines from `first` on end, as its end is
  /// missing: line, and column (from 1, in characters). REQUIRES: `first` begins outside of any
  /// text.
  [[nodiscard]] std::optional<std::pair<std::size_t, std::size_t>> open_text(
      std::size_t first) const {
    const std::string_view all = text(first, size());
    for (std::size_t at = 0; at < all.size();) {
      const std::string_view rest = all.substr(at);
      if (rest.starts_with("\"\"\"") || rest.starts_with("'''")) {
        const std::size_t bytes = text_bytes(rest);
        if (bytes == std::string_view::npos) return place_in(first, all.substr(0, at));
        at += bytes;
      } else if (rest.front() == '#') {
        at += std::min(rest.find('\n'), rest.size());
      } else if (rest.front() == '"' || rest.front() == '\'') {
        at += one_line_text_bytes(rest);
      } else {
        ++at;
      }
    }
    return std::nullopt;
  }
  /// Does a key or the header of a table begin there?
  [[nodiscard]] bool begins(std::size_t number) const { return begins(line(number)); }
  /// Blanks the lines first..last.
  void blank(std::size_t first, std::size_t last) {
    for (std::size_t at = begins_[first - 1]; at < begins_[last]; ++at) {
      if (text_[at] != '\n') text_[at] = ' ';
    }
  }
  /// The number that ends right before the column (from 1, in characters), and where it begins.
  [[nodiscard]] std::pair<std::string_view, std::size_t> number_before(std::size_t number,
                                                                       std::size_t column) const {
    constexpr std::string_view kNumberCharacters =
        "0123456789abcdefABCDEFox_+-";  // of a whole number of TOML
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
  /// Puts a `?` in place of each byte that is no UTF-8. Column (from 1, in characters) of the
  /// first; 0: there was none.
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
  /// Of a text over several lines with its quotes; npos: its end is missing.
  static std::size_t text_bytes(std::string_view text) {
    const char quote = text.front();
    for (std::size_t at = 3; at + 2 < text.size(); ++at) {
      if (quote == '"' && text[at] == '\\') {
        ++at;
      } else if (text[at] == quote && text[at + 1] == quote && text[at + 2] == quote) {
        // Two more may be the last of its letters.
        at += 3;
        for (int more = 0; more < 2 && at < text.size() && text[at] == quote; ++more) ++at;
        return at;
      }
    }
    return std::string_view::npos;
  }
  /// Of a text on one line with its quotes, or of what is left of the line where its end is
  /// missing.
  static std::size_t one_line_text_bytes(std::string_view text) {
    const char quote = text.front();
    std::size_t at = 1;
    for (; at < text.size() && text[at] != '\n'; ++at) {
      if (text[at] == quote) return at + 1;
      if (quote == '"' && text[at] == '\\' && at + 1 < text.size() && text[at + 1] != '\n') ++at;
    }
    return at;
  }
  /// Line and column behind `text`, which begins with the line `first`.
  static std::pair<std::size_t, std::size_t> place_in(std::size_t first, std::string_view text) {
    const auto line = first + static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
    const std::size_t begin = text.rfind('\n') + 1;  // 0 where there is none
    const auto characters =
        std::count_if(text.begin() + static_cast<std::ptrdiff_t>(begin), text.end(),
                      [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; });
    return {line, static_cast<std::size_t>(characters) + 1};
  }
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
    return line.starts_with('[') ||
           (line.find('=') != std::string_view::npos && !line.starts_with('#'));
  }

  std::string text_;                 ///< each line with its end
  std::vector<std::size_t> begins_;  ///< of each line, and behind the last
};

}  // namespace gimnet::hub
