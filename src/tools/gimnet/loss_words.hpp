#pragma once

#include <string>

#include "gimnet/gimi.hpp"

namespace gimnet::tool {

/// Why messages to `target` were lost, as a stream says it: of a node that was called by its name,
/// no_such_node means that it has left, not that an id is wrong. REQUIRES: that name was found
/// before.
[[nodiscard]] std::string loss_words(const SendCounts& counts, const std::string& target);

}  // namespace gimnet::tool
