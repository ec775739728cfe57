#include "tools/gimnet/table.hpp"

#include <algorithm>
#include <utility>

namespace gimnet::tool {

void Table::add(std::vector<std::string> cells, Tone tone) {
  widths_.resize(std::max(widths_.size(), cells.size()));
  for (std::size_t i = 0; i < cells.size(); ++i) {
    cells[i] = printable(cells[i]);
    widths_[i] = std::max(widths_[i], cells[i].size());
  }
  rows_.push_back({std::move(cells), tone});
}

std::string Table::text(Paint paint) const {
  std::string text;
  for (const Row& row : rows_) {
    std::string line;
    for (std::size_t i = 0; i < row.cells.size(); ++i) {
      line += row.cells[i];
      const bool last = i + 1 == row.cells.size();
      line.append(last ? 0 : widths_[i] - row.cells[i].size() + 2, ' ');
    }
    text += paint(line, row.tone) + '\n';
  }
  return text;
}

}  // namespace gimnet::tool
