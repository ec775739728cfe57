#pragma once

#include <string>
#include <string_view>

namespace gimnet::tool {

/// A sentence of the library for users of the tool: the commands that do the same stand in place of
/// calls. `target` is the node or service that the sentence is about; "": it is not known.
[[nodiscard]] std::string in_commands(std::string sentence, std::string_view target);

}  // namespace gimnet::tool
