#pragma once

#include <string>

namespace gimnet::tool {

/// Why messages to `target` were lost, as a stream says it: of a node that was called by its name, no_such_node means
/// that it has left, not that an id is wrong. REQUIRES: that name was found before.
[[nodiscard]] std::string loss_words(std::string loss, const std::string& target);

}  // namespace gimnet::tool
