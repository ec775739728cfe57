#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "gimnet/gimi.hpp"
#include "tools/gimnet/exit_code.hpp"
#include "tools/gimnet/losses.hpp"
#include "tools/gimnet/session.hpp"

namespace gimnet::tool {

/// The messages that did not come until one did.
struct Absent {
  std::uint64_t lost = 0;               ///< to this node, on the way
  std::optional<std::uint64_t> missed;  ///< of the message's service, where somebody counted
  std::uint64_t skipped = 0;            ///< of `missed`: for newer ones, of Delivery::latest
};

/// A message as a line for people; `named`: with its service.
[[nodiscard]] std::string text_line(const Message& message, bool named = false);
/// As an object.
[[nodiscard]] std::string json_line(const Message& message, const Absent& absent = {});

/// Takes the next message; waits for it at most so long.
using Receive = std::function<Outcome<Message>(Timeout)>;

/// Prints what comes, until as many have come or as much time has passed as the options say. Writes
/// at the latest when nothing more is there at once. Says so when the connection breaks and when it
/// is back, what was lost on its way, and what did not come where `missed` is given.
[[nodiscard]] ExitCode print_messages(ToolSession& session, const Receive& receive,
                                      MissedMessages* missed = nullptr);

}  // namespace gimnet::tool
