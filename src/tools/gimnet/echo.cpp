#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/printer.hpp"
#include "tools/gimnet/subscriptions.hpp"

namespace gimnet::tool {

ExitCode run_echo(Session& session) {
  if (const auto ending = session.join({})) return *ending;
  Subscriptions subscriptions(session.node(), session.options().target, session.options().pace);
  // Whoever asks for less than all has gaps on purpose.
  const bool all = !wants_less(session.options().pace);
  if (const auto opened = subscriptions.open(); !opened) return session.fail(opened.failure());
  if (const std::string words = subscriptions.waits_for(); !words.empty()) say(words);
  MissedMessages missed(
      [&](std::string_view service) { return subscriptions.take_lateness(service); });
  const ExitCode code = print_messages(
      session, [&](Timeout timeout) { return subscriptions.receive(timeout); },
      all ? &missed : nullptr);
  subscriptions.say_rest();
  return code;
}

}  // namespace gimnet::tool
