#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tools/gimnet/paint.hpp"

namespace gimnet::tool {

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
