#include "hub/config/toml_file.hpp"

#define TOML_EXCEPTIONS 0
// The library has two errors that a file can bring about, each undefined behaviour, and an abort
// where assertions are on: it takes for granted that the name of a table begins like one ("[?"),
// and that a letter like the umlauts outside of a text is a blank. Here the first is not taken for
// granted, and goes on to the error that the library has for such a name; the second is no blank.
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
#include <utility>

#include "base/log.hpp"
#include "proto/bitestream/utf8.hpp"

namespace gimnet::hub {
namespace {

constexpr std::size_t kQuotedLineMax = 120;
/// Their keys are told one by one, as "limits.nodes".
constexpr std::array<std::string_view, 2> kTables{"limits", "links"};
/// Limit: dots in a key. The library makes a table within a table of each, and frees them one
/// within the other.
constexpr std::size_t kKeyDotsMax = 64;

/// Names the positions of a file.
struct FilePositions {
  const std::string& name;

  [[nodiscard]] std::string of(std::size_t line, std::size_t column) const {
    return name + ":" + std::to_string(line) + ":" + std::to_string(column);
  }
  [[nodiscard]] std::string of(const toml::source_region& source) const {
    return of(source.begin.line, source.begin.column);
  }
};

/// The words between the first pair of quotes; "" if there is none.
std::string_view quoted_part(std::string_view text) {
  const std::size_t first = text.find('\'');
  const std::size_t last = text.rfind('\'');
  return first >= last ? std::string_view{} : text.substr(first + 1, last - first - 1);
}

ConfigFault fault_of(const toml::parse_error& error, const FilePositions& positions) {
  std::string_view what = error.description();
  if (const std::size_t colon = what.find(": ");
      what.starts_with("Error while") && colon != std::string_view::npos) {
    what.remove_prefix(colon + 2);
  }
  const std::string place = positions.of(error.source());
  if (what.starts_with("cannot redefine")) {
    return {place, "'" + escaped(quoted_part(what), kQuotedLineMax) +
                       "' is given twice; leave one of them out"};
  }
  if (what.ends_with("is not representable in 64 bits")) {
    return {place, "a number that does not fit in 64 bits ends here; give one that is nearer to 0"};
  }
  return {place, "this is not TOML: " + escaped(what, kQuotedLineMax) +
                     "; write KEY = VALUE, texts in quotes (nothing else of this file was read)"};
}

/// Dots that may separate the parts of a key: none of those in a value behind it.
std::size_t key_dots(std::string_view line) {
  const std::size_t first = std::min(line.find_first_not_of(" \t"), line.size());
  line.remove_prefix(first);
  const std::size_t end = line.starts_with('[') ? line.size() : line.rfind('=');
  if (end == std::string_view::npos || line.starts_with('#')) return 0;
  return static_cast<std::size_t>(std::ranges::count(line.substr(0, end), '.'));
}

/// The first line that the library is not to see: it recurses for each part of a key.
std::optional<ConfigFault> fault_of_lines(std::string_view text, const FilePositions& positions) {
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::string_view line = text.substr(0, text.find('\n'));
    const auto* bytes = reinterpret_cast<const unsigned char*>(line.data());
    if (!proto::bitestream::valid_utf8(bytes, line.size())) {
      return ConfigFault{positions.of(number, 1),
                         "a byte of this line is not UTF-8 text; save the file in that encoding"};
    }
    if (key_dots(line) > kKeyDotsMax) {
      return ConfigFault{
          positions.of(number, 1),
          "no key has so many parts; write KEY = VALUE, or LIMIT = VALUE below [limits]"};
    }
    text.remove_prefix(std::min(line.size() + 1, text.size()));
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

ConfigValue::Kind kind_of(const toml::node& node) {
  using Kind = ConfigValue::Kind;
  if (node.is_string()) return Kind::text;
  if (node.is_integer()) return Kind::integer;
  if (node.is_boolean()) return Kind::boolean;
  if (node.is_floating_point()) return Kind::fraction;
  if (node.is_array()) return Kind::list;
  return node.is_table() ? Kind::table : Kind::time;
}

/// Lists within tables within a list: [[link]] with its `allow`. Deeper ones are wrong whatever is
/// in them.
constexpr int kDepthMax = 3;

ConfigValue value_of(const toml::node& node, const FilePositions& positions, int depth = 0) {
  ConfigValue value;
  value.kind = kind_of(node);
  value.text = text_of(node);
  value.place = positions.of(node.source());
  if (depth == kDepthMax) return value;
  if (const toml::array* list = node.as_array()) {
    for (const toml::node& item : *list)
      value.items.push_back(value_of(item, positions, depth + 1));
  }
  if (const toml::table* table = node.as_table(); table != nullptr && depth > 0) {
    for (auto&& [key, item] : *table) {
      value.items.push_back(value_of(item, positions, depth + 1));
      value.items.back().key = key.str();
    }
  }
  return value;
}

Given given_of(const std::string& name, const toml::key& written, const toml::node& node,
               const FilePositions& positions) {
  return {name, value_of(node, positions), positions.of(written.source()), name,
          positions.name + ":" + std::to_string(written.source().begin.line)};
}

std::vector<Given> keys_of(const toml::table& table, const FilePositions& positions) {
  using Position = std::pair<std::size_t, std::size_t>;
  std::vector<std::pair<Position, Given>> found;
  const auto add = [&](const std::string& name, const toml::key& key, const toml::node& node) {
    const auto& begin = key.source().begin;
    found.emplace_back(Position{begin.line, begin.column}, given_of(name, key, node, positions));
  };
  for (auto&& [key, node] : table) {
    const std::string name{key.str()};
    const bool known = std::ranges::find(kTables, name) != kTables.end();
    const toml::table* inner = known ? node.as_table() : nullptr;
    // Of a table that nobody knows only its name is told, and of an empty one.
    if (inner == nullptr || inner->empty()) {
      add(name, key, node);
      continue;
    }
    for (auto&& [own, value] : *inner) add(name + "." + std::string{own.str()}, own, value);
  }
  std::ranges::stable_sort(found, {}, &std::pair<Position, Given>::first);
  std::vector<Given> keys;
  keys.reserve(found.size());
  for (auto& [at, given] : found) keys.push_back(std::move(given));
  return keys;
}

}  // namespace

TomlFile read_toml(std::string_view text, const std::string& name) {
  const FilePositions positions{name};
  TomlFile file;
  if (text.size() > kConfigBytesMax) {
    file.faults.push_back({positions.of(1, 1), "the file is over " +
                                                   std::to_string(kConfigBytesMax) +
                                                   " bytes; is it a configuration of tcphub?"});
    return file;
  }
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);  // a mark of the encoding
  if (const std::optional<ConfigFault> fault = fault_of_lines(text, positions)) {
    file.faults.push_back(*fault);
    return file;
  }
  const toml::parse_result parsed = toml::parse(text);
  if (parsed) {
    file.keys = keys_of(parsed.table(), positions);
  } else {
    file.faults.push_back(fault_of(parsed.error(), positions));
  }
  return file;
}

std::string toml_quoted(std::string_view text) {
  std::string quoted = "\"";
  for (const char c : text) {
    std::array<char, 8> code{};
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      std::snprintf(code.data(), code.size(), "\\u%04x",
                    static_cast<unsigned>(static_cast<unsigned char>(c)));
      quoted += code.data();
    } else {
      quoted += c;
    }
  }
  return quoted + "\"";
}

}  // namespace gimnet::hub
