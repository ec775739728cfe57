#include "hub/config/toml_file.hpp"

#define TOML_EXCEPTIONS 0
// The library has two errors that a file can bring about, each undefined behaviour, and an abort where assertions are
// on: it takes for granted that the name of a table begins like one ("[?"), and that a letter like the umlauts outside
// of a text is a blank. Here the first is not taken for granted, and goes on to the error that the library has for such
// a name; the second is no blank.
#include <toml++/impl/forward_declarations.h>
#undef TOML_ASSERT_ASSUME
#define TOML_ASSERT_ASSUME(expr) static_assert(true)
#undef TOML_UNREACHABLE
#define TOML_UNREACHABLE return false
#include <toml++/impl/unicode.h>
#undef TOML_UNREACHABLE
#define TOML_UNREACHABLE __builtin_unreachable()
#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "base/log.hpp"
#include "proto/bitestream/utf8.hpp"

namespace gimnet::hub {
namespace {

constexpr std::size_t kQuotedMax = 120;
constexpr std::string_view kOnlyTable = "limits";
/// What a whole number of TOML may consist of.
constexpr std::string_view kNumberCharacters = "0123456789abcdefABCDEFox_+-";
/// Each try to read the rest leaves out one line more at least; a file that needs more of them is left alone.
constexpr std::size_t kTriesMax = 2 * kConfigFaultsMax;
/// Stands for a table whose header cannot be read: what is in it is nobody's.
constexpr std::string_view kLostTable = "\\u0000lost";

/// A text by lines, each of which can be left out without moving the others.
class Lines {
 public:
  explicit Lines(std::string_view text) {
    for (std::size_t at = 0; at <= text.size();) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      lines_.emplace_back(text.substr(at, end - at));
      at = end + 1;
    }
  }
  [[nodiscard]] std::size_t size() const { return lines_.size(); }

  /// The line, from `number` (counted from 1) upward, where a key or a table begins.
  [[nodiscard]] std::size_t beginning(std::size_t number) const {
    while (number > 1 && !begins(lines_[number - 1])) --number;
    return number;
  }
  /// Empties the lines first..last; a table's header becomes that of a lost one.
  void leave_out(std::size_t first, std::size_t last) {
    for (std::size_t number = first; number <= std::min(last, lines_.size()); ++number) {
      std::string& line = lines_[number - 1];
      const bool header = trimmed(line).starts_with('[');
      line = header ? "[\"" + std::string{kLostTable} + std::to_string(number) + "\"]" : std::string{};
    }
  }
  /// The number that ends right before the column (from 1, in characters), and where it begins.
  [[nodiscard]] std::pair<std::string_view, std::size_t> number_before(std::size_t number, std::size_t column) const {
    const std::string_view line = lines_[number - 1];
    std::size_t end = 0;
    for (std::size_t at = 1; at < column && end < line.size(); ++at) {
      end += std::max<std::size_t>(character_size(line.substr(end)), 1);
    }
    std::size_t begin = end;
    while (begin > 0 && kNumberCharacters.find(line[begin - 1]) != std::string_view::npos) --begin;
    return {line.substr(begin, end - begin), column - (end - begin)};
  }
  /// Column (from 1, in bytes) of the first character that is no blank.
  [[nodiscard]] std::size_t first_column(std::size_t number) const {
    const std::string_view line = lines_[number - 1];
    return line.size() - trimmed(line).size() + 1;
  }
  /// Puts a `?` in place of each byte that is no UTF-8. Column (from 1, in characters) of the first; 0: there was none.
  [[nodiscard]] std::size_t mend_text(std::size_t number) {
    std::string& line = lines_[number - 1];
    std::size_t first = 0;
    for (std::size_t at = 0, column = 1; at < line.size(); ++column) {
      const std::size_t size = character_size(std::string_view{line}.substr(at));
      if (size == 0) line[at] = '?';
      if (size == 0 && first == 0) first = column;
      at += std::max<std::size_t>(size, 1);
    }
    return first;
  }
  [[nodiscard]] std::string text() const { return text(1, lines_.size()); }
  /// The lines first..last, counted from 1.
  [[nodiscard]] std::string text(std::size_t first, std::size_t last) const {
    std::string some;
    for (std::size_t number = first; number <= last; ++number) some += lines_[number - 1] + "\n";
    return some;
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
  std::vector<std::string> lines_;
};

std::string place_of(const std::string& name, std::size_t line, std::size_t column) {
  return name + ":" + std::to_string(line) + ":" + std::to_string(column);
}

std::string place_of(const std::string& name, const toml::source_region& source) {
  return place_of(name, source.begin.line, source.begin.column);
}

/// The words between the first pair of quotes; "" if there is none.
std::string_view quoted_part(std::string_view text) {
  const std::size_t first = text.find('\'');
  const std::size_t last = text.rfind('\'');
  return first >= last ? std::string_view{} : text.substr(first + 1, last - first - 1);
}

Fault fault_of(const toml::parse_error& error, const Lines& lines, const std::string& name) {
  std::string_view what = error.description();
  if (const std::size_t colon = what.find(": "); what.starts_with("Error while") && colon != std::string_view::npos) {
    what.remove_prefix(colon + 2);
  }
  const std::size_t line = std::clamp<std::size_t>(error.source().begin.line, 1, lines.size());
  if (what.starts_with("cannot redefine")) {
    return {place_of(name, line, lines.first_column(line)),
            "'" + escaped(quoted_part(what), kQuotedMax) + "' is given twice; leave one of them out"};
  }
  if (what.ends_with("is not representable in 64 bits")) {
    // It is told behind the number.
    const auto [number, column] = lines.number_before(line, error.source().begin.column);
    return {place_of(name, line, column), "no key can be '" + escaped(number, kQuotedMax) +
                                              "': it does not fit in 64 bits; give a number that is nearer to 0"};
  }
  return {place_of(name, line, error.source().begin.column),
          "this is not TOML: " + escaped(what, kQuotedMax) + "; write KEY = VALUE, texts in quotes"};
}

/// What is no UTF-8, by lines. The parser would say so at the character before, and get no further.
std::set<std::size_t> mend_text(Lines& lines, const std::string& name, Faults& faults) {
  std::set<std::size_t> mended;
  for (std::size_t number = 1; number <= lines.size() && faults.size() < kConfigFaultsMax; ++number) {
    const std::size_t column = lines.mend_text(number);
    if (column == 0) continue;
    mended.insert(number);
    faults.push_back({place_of(name, number, column), "this is not UTF-8 text; save the file in that encoding"});
  }
  return mended;
}

bool is_at_end(const toml::parse_error& error) {
  return error.description().find("end-of-file") != std::string_view::npos;
}

/// A list that is not closed takes what follows for its values, so the parser complains of the next key, or of the end.
/// The lines of such a list before the error; none: that is not what is wrong.
std::optional<std::pair<std::size_t, std::size_t>> open_list_before(const Lines& lines, std::size_t line, bool at_end) {
  const std::size_t last = at_end ? lines.size() : line - 1;
  if (last == 0) return std::nullopt;
  if (!at_end && !toml::parse(lines.text(line, line))) return std::nullopt;
  const std::size_t first = lines.beginning(last);
  const toml::parse_result part = toml::parse(lines.text(first, last));
  const bool is_open =
      !part && is_at_end(part.error()) && part.error().description().find("array") != std::string_view::npos;
  return is_open ? std::optional(std::pair(first, last)) : std::nullopt;
}

/// Parses as much as can be made sense of. Nothing: too much is wrong.
std::optional<toml::table> parse(std::string_view text, const std::string& name, Faults& faults) {
  Lines lines(text);
  const std::set<std::size_t> mended = mend_text(lines, name, faults);
  std::size_t left_out_from = 0;  // the last lines that were left out; 0: none
  std::size_t left_out_to = 0;
  for (std::size_t tries = 0; tries < kTriesMax && faults.size() < kConfigFaultsMax; ++tries) {
    toml::parse_result parsed = toml::parse(tries == 0 && mended.empty() ? std::string{text} : lines.text());
    if (parsed) return std::move(parsed).table();
    const toml::parse_error& error = parsed.error();
    const std::size_t line = std::clamp<std::size_t>(error.source().begin.line, 1, lines.size());
    const bool at_end = is_at_end(error);
    if (const auto list = open_list_before(lines, line, at_end)) {
      std::tie(left_out_from, left_out_to) = *list;
      faults.push_back({place_of(name, left_out_from, lines.first_column(left_out_from)),
                        "this is not TOML: the list that begins here is not closed; end it with ]"});
    } else if (left_out_from != 0 && (at_end || line <= left_out_to)) {
      // What was left out was the end of something that began further up.
      if (left_out_from == 1) return std::nullopt;
      left_out_from = lines.beginning(left_out_from - 1);
    } else {
      if (!mended.contains(line)) faults.push_back(fault_of(error, lines, name));
      left_out_from = left_out_to = line;
    }
    lines.leave_out(left_out_from, left_out_to);
  }
  return std::nullopt;
}

template <class Node>
std::string text_of(const Node& node) {
  std::array<char, 64> number{};
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* integer = node.as_integer()) return std::to_string(integer->get());
  if (const auto* boolean = node.as_boolean()) return boolean->get() ? "true" : "false";
  if (const auto* fraction = node.as_floating_point()) {
    std::snprintf(number.data(), number.size(), "%g", fraction->get());
    return number.data();
  }
  return {};
}

Value::Kind kind_of(const toml::node& node) {
  switch (node.type()) {
    case toml::node_type::string:
      return Value::Kind::text;
    case toml::node_type::integer:
      return Value::Kind::integer;
    case toml::node_type::boolean:
      return Value::Kind::boolean;
    case toml::node_type::floating_point:
      return Value::Kind::fraction;
    case toml::node_type::array:
      return Value::Kind::list;
    case toml::node_type::table:
      return Value::Kind::table;
    default:
      return Value::Kind::time;
  }
}

Value value_of(const toml::node& node, const std::string& name) {
  Value value;
  value.kind = kind_of(node);
  value.text = text_of(node);
  value.place = place_of(name, node.source());
  // Nothing is a list of lists: deeper ones are wrong whatever is in them.
  if (const toml::array* list = node.as_array()) {
    for (const toml::node& item : *list) {
      value.items.push_back({kind_of(item), text_of(item), {}, place_of(name, item.source())});
    }
  }
  return value;
}

struct Found {
  toml::source_position at;
  Given given;
};

Found found(const std::string& key, const toml::key& written, const toml::node& node, const std::string& name) {
  const auto& at = written.source().begin;
  return {at, Given{key, value_of(node, name), place_of(name, written.source()), key,
                    name + ":" + std::to_string(at.line)}};
}

}  // namespace

TomlFile read_toml(std::string_view text, const std::string& name) {
  TomlFile file;
  if (text.size() > kConfigBytesMax) {
    file.faults.push_back({place_of(name, 1, 1), "the file is over " + std::to_string(kConfigBytesMax) +
                                                     " bytes; is it a configuration of tcphub?"});
    return file;
  }
  const std::optional<toml::table> table = parse(text, name, file.faults);
  if (!table) return file;
  std::vector<Found> all;
  for (auto&& [key, node] : *table) {
    if (!file.faults.empty() && key.str().starts_with('\0')) continue;
    const std::string outer{key.str()};
    const toml::table* inner = node.as_table();
    if (inner == nullptr) {
      all.push_back(found(outer, key, node, name));
      continue;
    }
    // Of a table that nobody knows only its name is told.
    if (inner->empty() || outer != kOnlyTable) all.push_back(found(outer, key, node, name));
    if (outer != kOnlyTable) continue;
    for (auto&& [inner_key, inner_node] : *inner) {
      all.push_back(found(outer + "." + std::string{inner_key.str()}, inner_key, inner_node, name));
    }
  }
  std::ranges::sort(all, [](const Found& a, const Found& b) {
    return std::pair{a.at.line, a.at.column} < std::pair{b.at.line, b.at.column};
  });
  for (Found& each : all) file.keys.push_back(std::move(each.given));
  return file;
}

std::string toml_quoted(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    std::array<char, 8> code{};
    if (c == '"' || c == '\\') {
#ifndef GIMNET_BUG_QUOTES_NOT_ESCAPED
      quoted += '\\';
#endif
      quoted += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      std::snprintf(code.data(), code.size(), "\\u%04x", static_cast<unsigned>(static_cast<unsigned char>(c)));
      quoted += code.data();
    } else {
      quoted += c;
    }
  }
  return quoted + "\"";
}

}  // namespace gimnet::hub
