#pragma once

#include <cstdint>

#include "gimnet/gimi.hpp"
#include "tools/gimnet/exit_code.hpp"
#include "tools/gimnet/session.hpp"

namespace gimnet::tool {

/// A message as a line: `raw` the payload alone, `json` an object, else for people.
[[nodiscard]] std::string text_line(const Message& message);
[[nodiscard]] std::string json_line(const Message& message);

/// Prints what comes into a queue, until as many have come as the options say. Writes at the latest when nothing more
/// is there at once. Says so when the connection breaks and when it is back.
[[nodiscard]] ExitCode print_messages(Session& session, const Queue& queue);

}  // namespace gimnet::tool
