#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace gimnet::tool {

/// Rows of text in columns as wide as they need. Thread safety: one thread.
class Table {
 public:
  explicit Table(std::vector<std::string> titles) { add(std::move(titles)); }
  /// REQUIRES: as many cells as titles.
  void add(std::vector<std::string> cells);
  [[nodiscard]] std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
  std::vector<std::size_t> widths_;
};

}  // namespace gimnet::tool
