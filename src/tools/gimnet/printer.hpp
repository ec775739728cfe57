#pragma once

#include <functional>
#include <string>

#include "gimnet/gimi.hpp"
#include "tools/gimnet/exit_code.hpp"
#include "tools/gimnet/session.hpp"

namespace gimnet::tool {

/// A message as a line, for people and as an object.
[[nodiscard]] std::string text_line(const Message& message);
[[nodiscard]] std::string json_line(const Message& message);

/// Takes the next message; waits for it at most so long.
using Receive = std::function<Outcome<Message>(Timeout)>;

/// Prints what comes, until as many have come or as much time has passed as the options say. Writes at the latest when
/// nothing more is there at once. Says so when the connection breaks and when it is back.
[[nodiscard]] ExitCode print_messages(Session& session, const Receive& receive);

}  // namespace gimnet::tool
