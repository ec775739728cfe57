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
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "base/log.hpp"
#include "hub/config/toml_lines.hpp"

namespace gimnet::hub {
namespace {

constexpr std::size_t kQuotedLineMax = 120;
constexpr std::string_view kOnlyTable = "limits";
/// Bytes that may be parsed in vain to find where something begins of which the end was left out; a
/// file that needs more is left alone from there.
constexpr std::size_t kVainBytesMax = std::size_t{16} << 20;
/// Dots in a key: the library makes a table within a table of each, and frees them one within the
/// other.
constexpr std::size_t kKeyDotsMax = 64;

/// Where something stands in a file of which a part was parsed.
struct Places {
  const std::string& name;
  std::size_t first = 1;  ///< the part's first line

  [[nodiscard]] std::size_t line(const toml::source_region& source) const {
    return first - 1 + source.begin.line;
  }
  [[nodiscard]] std::string of(std::size_t line, std::size_t column) const {
    return name + ":" + std::to_string(line) + ":" + std::to_string(column);
  }
  [[nodiscard]] std::string of(const toml::source_region& source) const {
    return of(line(source), source.begin.column);
  }
};

/// The words between the first pair of quotes; "" if there is none.
std::string_view quoted_part(std::string_view text) {
  const std::size_t first = text.find('\'');
  const std::size_t last = text.rfind('\'');
  return first >= last ? std::string_view{} : text.substr(first + 1, last - first - 1);
}

std::string given_twice(std::string_view key) {
  return "'" + escaped(key, kQuotedLineMax) + "' is given twice; leave one of them out";
}

Fault fault_of(const toml::parse_error& error, std::size_t line, const TomlLines& lines,
               const Places& places) {
  std::string_view what = error.description();
  if (const std::size_t colon = what.find(": ");
      what.starts_with("Error while") && colon != std::string_view::npos) {
    what.remove_prefix(colon + 2);
  }
  const std::size_t column = error.source().begin.column;
  if (what.starts_with("cannot redefine")) {
    return {places.of(line, lines.first_column(line)), given_twice(quoted_part(what))};
  }
  if (what.ends_with("is not representable in 64 bits")) {
    // It is told behind the number.
    const auto [number, begin] = lines.number_before(line, column);
    return {places.of(line, begin),
            "no key can be '" + escaped(number, kQuotedLineMax) +
                "': it does not fit in 64 bits; give a number that is nearer to 0"};
  }
  return {places.of(line, column), "this is not TOML: " + escaped(what, kQuotedLineMax) +
                                       "; write KEY = VALUE, texts in quotes"};
}

bool is_at_end(const toml::parse_error& error) {
  return error.description().find("end-of-file") != std::string_view::npos;
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

Value value_of(const toml::node& node, const Places& places) {
  Value value;
  value.kind = kind_of(node);
  value.text = text_of(node);
  value.place = places.of(node.source());
  // Nothing is a list of lists: deeper ones are wrong whatever is in them.
  if (const toml::array* list = node.as_array()) {
    for (const toml::node& item : *list) {
      value.items.push_back({kind_of(item), text_of(item), {}, places.of(item.source())});
    }
  }
  return value;
}

/// Reads a file part by part: what stands before something that is no TOML is taken for itself, so
/// that each byte is parsed a few times only, however much is wrong.
class Reading {
 public:
  Reading(std::string_view text, const std::string& name, std::size_t faults_max)
      : lines_(text), places_{name}, faults_max_(faults_max) {}

  TomlFile read() {
    look_at_lines();
    while (places_.first <= lines_.size() && file_.faults.size() < faults_max_) {
      const toml::parse_result parsed = toml::parse(lines_.text(places_.first, lines_.size()));
      if (parsed) {
        take(parsed.table());
        break;
      }
      leave_out(parsed.error());
      if (!take_what_is_before() && vain_bytes_ > kVainBytesMax) {
        file_.faults.push_back({places_.of(left_out_from_, lines_.first_column(left_out_from_)),
                                "what follows here cannot be made sense of; mend what stands above "
                                "it, then look again"});
        break;
      }
    }
    // The table itself is worth telling only where nothing is in it.
    if (any_limit_)
      std::erase_if(found_, [](const Found& each) { return each.given.key == kOnlyTable; });
    std::ranges::stable_sort(found_, {}, &Found::at);
    for (Found& each : found_) file_.keys.push_back(std::move(each.given));
    return std::move(file_);
  }

 private:
  /// In which table the next key stands.
  enum class Inside : std::uint8_t { nothing, limits, unknown };
  struct Found {
    std::pair<std::size_t, std::size_t> at;  ///< line, column
    Given given;
  };
  struct Known {
    bool is_table = false;
  };

  /// What the parser is not to see. Of what is no UTF-8 it would say so at the character before,
  /// and get no further.
  void look_at_lines() {
    for (std::size_t number = 1; number <= lines_.size() && file_.faults.size() < faults_max_;
         ++number) {
      if (const std::size_t column = lines_.mend_text(number); column != 0) {
        mended_.insert(number);
        file_.faults.push_back(
            {places_.of(number, column), "this is not UTF-8 text; save the file in that encoding"});
      }
      if (lines_.key_dots(number) > kKeyDotsMax) {
        file_.faults.push_back(
            {places_.of(number, lines_.first_column(number)),
             "no key has so many parts; write KEY = VALUE, or LIMIT = VALUE below [limits]"});
        lines_.blank(number, number);
      }
    }
  }

  /// Tells what is wrong and blanks it.
  void leave_out(const toml::parse_error& error) {
    const std::size_t line =
        std::clamp<std::size_t>(places_.line(error.source()), places_.first, lines_.size());
    const bool at_end = is_at_end(error);
    const bool nothing_left_out = left_out_from_ == 0;
    if (const auto text =
            at_end && nothing_left_out ? lines_.open_text(places_.first) : std::nullopt) {
      left_out_from_ = lines_.beginning(text->first, places_.first);
      left_out_to_ = last_of_open_text(text->first);
      file_.faults.push_back({places_.of(text->first, text->second),
                              "this is not TOML: the text that begins here is not closed; end it "
                              "with its three quotes"});
    } else if (const auto list = open_list_before(line, at_end)) {
      std::tie(left_out_from_, left_out_to_) = *list;
      file_.faults.push_back(
          {places_.of(left_out_from_, lines_.first_column(left_out_from_)),
           "this is not TOML: the list that begins here is not closed; end it with ]"});
    } else if (left_out_from_ != 0 && (at_end || line <= left_out_to_)) {
      // What was left out was the end of something that began further up.
      left_out_from_ = lines_.beginning(left_out_from_ - 1, places_.first);
    } else {
      if (!mended_.contains(line)) file_.faults.push_back(fault_of(error, line, lines_, places_));
      left_out_from_ = left_out_to_ = line;
    }
    header_left_out_ = lines_.is_header(left_out_from_);
    lines_.blank(left_out_from_, left_out_to_);
  }
  /// A text that is not closed takes all that follows. Its last line, as far as can be guessed:
  /// before the next one that is a key or a header for itself.
  [[nodiscard]] std::size_t last_of_open_text(std::size_t first) const {
    std::size_t last = first;
    while (last < lines_.size() && !(lines_.begins(last + 1) && toml::parse(lines_.line(last + 1))))
      ++last;
    return last;
  }
  /// A list that is not closed takes what follows for its values, so the parser complains of the
  /// next key, or of the end. The lines of such a list before the error; none: that is not what is
  /// wrong.
  [[nodiscard]] std::optional<std::pair<std::size_t, std::size_t>> open_list_before(
      std::size_t line, bool at_end) const {
    const std::size_t last = at_end ? lines_.size() : line - 1;
    if (last < places_.first) return std::nullopt;
    if (!at_end && !toml::parse(lines_.text(line, line))) return std::nullopt;
    const std::size_t first = lines_.beginning(last, places_.first);
    const toml::parse_result part = toml::parse(lines_.text(first, last));
    const bool is_open = !part && is_at_end(part.error()) &&
                         part.error().description().find("array") != std::string_view::npos;
    return is_open ? std::optional(std::pair(first, last)) : std::nullopt;
  }
  /// False: something that begins before what was left out does not end there.
  [[nodiscard]] bool take_what_is_before() {
    const toml::parse_result before = toml::parse(lines_.text(places_.first, left_out_from_ - 1));
    if (!before) {
      vain_bytes_ += lines_.text(places_.first, left_out_to_).size();
      return false;
    }
    take(before.table());
    if (header_left_out_) inside_ = Inside::unknown;  // what stands below it is nobody's
    places_.first = left_out_to_ + 1;
    left_out_from_ = left_out_to_ = 0;
    return true;
  }

  /// The keys of a part. Those before its first header belong to the table of the part before.
  void take(const toml::table& part) {
    last_header_ = 0;
    for (auto&& [key, node] : part) {
      if (inside_ == Inside::nothing || lines_.is_header(places_.line(key.source()))) {
        take_outer(key, node);
      } else if (inside_ == Inside::limits) {
        take_limit(key, node);
      }
      note_headers(node);
    }
    if (last_header_ != 0) inside_ = what_begins_at(last_header_);
  }
  void take_outer(const toml::key& key, const toml::node& node) {
    const std::string outer{key.str()};
    const toml::table* inner = node.as_table();
    const auto [known, is_new] = known_.try_emplace(outer, Known{inner != nullptr});
    const bool is_header = lines_.is_header(places_.line(key.source()));
    if (!is_new) {
      // A table may go on by dotted keys and with tables in it, and a list of tables with one table
      // more.
      const bool begins_again =
          is_header && inner != nullptr && begins_alone(places_.line(key.source()));
      const bool goes_on = inner != nullptr ? known->second.is_table && !begins_again : is_header;
      if (!goes_on) return tell_twice(key);
    }
    const bool is_limits = outer == kOnlyTable && inner != nullptr;
    // Of a table that nobody knows only its name is told.
    if (is_new && (!is_limits || inner->empty())) add(outer, key, node);
    if (!is_limits) return;
    for (auto&& [inner_key, inner_node] : *inner) take_limit(inner_key, inner_node);
  }
  void take_limit(const toml::key& key, const toml::node& node) {
    const std::string name = std::string{kOnlyTable} + "." + std::string{key.str()};
    if (!known_.try_emplace(name).second) return tell_twice(key);
    any_limit_ = true;
    add(name, key, node);
  }
  void tell_twice(const toml::key& key) {
    const std::size_t line = places_.line(key.source());
    file_.faults.push_back({places_.of(line, lines_.first_column(line)), given_twice(key.str())});
  }
  void add(const std::string& name, const toml::key& written, const toml::node& node) {
    const std::size_t line = places_.line(written.source());
    found_.push_back({{line, written.source().begin.column},
                      Given{name, value_of(node, places_), places_.of(written.source()), name,
                            places_.name + ":" + std::to_string(line)}});
  }
  /// Where the last table of the part begins.
  void note_headers(const toml::node& node) {
    const std::size_t line = places_.line(node.source());
    if (node.is_table() && lines_.is_header(line)) last_header_ = std::max(last_header_, line);
    if (const toml::table* table = node.as_table()) {
      for (auto&& [key, inner] : *table) note_headers(inner);
    } else if (const toml::array* list = node.as_array();
               list != nullptr && list->is_array_of_tables()) {
      for (const toml::node& inner : *list) note_headers(inner);
    }
  }
  [[nodiscard]] Inside what_begins_at(std::size_t header) const {
    const toml::parse_result alone = toml::parse(lines_.line(header));
    const bool limits =
        alone && alone.table().size() == 1 && alone.table().begin()->first.str() == kOnlyTable;
    return limits && begins_alone(header) ? Inside::limits : Inside::unknown;
  }
  /// Is it the header of a table that is in no other, and no list of them?
  [[nodiscard]] bool begins_alone(std::size_t header) const {
    const toml::parse_result alone = toml::parse(lines_.line(header));
    if (!alone || alone.table().size() != 1) return false;
    const toml::table* inner = alone.table().begin()->second.as_table();
    return inner != nullptr && inner->empty();
  }

  TomlLines lines_;
  Places places_;  ///< of the part that is read
  const std::size_t faults_max_;
  TomlFile file_;
  std::vector<Found> found_;
  std::map<std::string, Known, std::less<>>
      known_;                     ///< keys, limits by their full names, and tables
  std::set<std::size_t> mended_;  ///< lines
  Inside inside_ = Inside::nothing;
  std::size_t last_header_ = 0;
  std::size_t vain_bytes_ = 0;     ///< parsed so far
  std::size_t left_out_from_ = 0;  ///< the last lines that were left out and not passed; 0: none
  std::size_t left_out_to_ = 0;
  bool header_left_out_ = false;
  bool any_limit_ = false;
};

}  // namespace

TomlFile read_toml(std::string_view text, const std::string& name, std::size_t faults_max) {
  if (text.size() > kConfigBytesMax) {
    TomlFile file;
    file.faults.push_back({Places{name}.of(1, 1), "the file is over " +
                                                      std::to_string(kConfigBytesMax) +
                                                      " bytes; is it a configuration of tcphub?"});
    return file;
  }
  return Reading(text, name, faults_max).read();
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
