#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/printer.hpp"
#include "tools/gimnet/subscriptions.hpp"

namespace gimnet::tool {

ExitCode run_echo(Session& session) {
  if (const auto ending = session.join({})) return *ending;
  Subscriptions subscriptions(session.node(), session.options().target, session.options().pace);
  if (const auto opened = subscriptions.open(); !opened) return session.fail(opened.failure());
  if (const std::string words = subscriptions.waits_for(); !words.empty()) say(words);
  // Whoever asks for less than all has gaps on purpose.
  const PaceOptions& pace = session.options().pace;
  const bool all = pace.window == 0 && pace.depth == PaceOptions{}.depth && pace.rate_hz <= 0.0;
  MissedMessages missed;
  return print_messages(
      session, [&](Timeout timeout) { return subscriptions.receive(timeout); }, all ? &missed : nullptr);
}

}  // namespace gimnet::tool
