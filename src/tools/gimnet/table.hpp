#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "tools/gimnet/options.hpp"

namespace gimnet::tool {

/// A number for people: with `places` digits behind the point, or, without them, as few as it needs
/// (at most 6).
[[nodiscard]] std::string decimal(double value, int places);
[[nodiscard]] std::string decimal(double value);
/// Bytes with the unit that suits them, powers of 1,000: "999 B", "1.5 kB", "2.0 MB".
[[nodiscard]] std::string byte_count(double bytes);

/// The meaning of a text, from which its colour follows.
enum class Tone : std::uint8_t { plain, heading, warning, bad };

/// Colours text, or leaves it as it is. Thread safety: immutable.
class Paint {
 public:
  explicit Paint(bool on = false) : on_(on) {}
  /// As the option says; automatic: `descriptor` is a terminal that knows colours, and NO_COLOR is
  /// not set or empty.
  [[nodiscard]] static Paint of(Colour colour, int descriptor);

  [[nodiscard]] bool on() const { return on_; }
  [[nodiscard]] std::string operator()(std::string_view text, Tone tone) const;

 private:
  bool on_;
};

/// Text of others for people, a '.' for each control character: they would let it write over the
/// terminal, or turn what is written.
[[nodiscard]] std::string printable(std::string_view text);
/// Bytes of what stands first, if it is a control character: C0, DEL, and in UTF-8 C1, ends of
/// lines and paragraphs, and what turns the direction of writing, so that another text is seen than
/// there is. 0: it is none.
[[nodiscard]] std::size_t control_size(std::string_view text);

/// Rows of text in columns as wide as they need. Control characters are shown as '.'. Thread
/// safety: one thread.
class Table {
 public:
  explicit Table(std::vector<std::string> titles) { add(std::move(titles), Tone::heading); }
  /// REQUIRES: as many cells as titles.
  void add(std::vector<std::string> cells, Tone tone = Tone::plain);
  [[nodiscard]] std::string text(Paint paint = Paint{}) const;

 private:
  struct Row {
    std::vector<std::string> cells;
    Tone tone = Tone::plain;
  };
  std::vector<Row> rows_;
  std::vector<std::size_t> widths_;
};

}  // namespace gimnet::tool
