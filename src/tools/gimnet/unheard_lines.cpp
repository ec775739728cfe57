#include "tools/gimnet/unheard_lines.hpp"

namespace gimnet::tool {

std::string UnheardLines::sentence(const std::string& service, bool waited) const {
  if (unheard_ == 0) return {};
  const std::string all = std::to_string(lines_);
  std::string count = std::to_string(unheard_) + " of " + all + " lines went to nobody: ";
  if (unheard_ == lines_)
    count = lines_ == 1 ? "the line went to nobody: " : "all " + all + " lines went to nobody: ";
  if (waited) return count + "the last subscriber of " + service + " had left";
  return count + "nobody had subscribed to " + service +
         " then; --wait 1 holds the first until somebody has";
}

}  // namespace gimnet::tool
