#include "tools/gimnet/receive.hpp"

#include <string>

#include "base/clock.hpp"
#include "tools/gimnet/bounds.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/losses.hpp"
#include "tools/gimnet/session.hpp"
#include "tools/gimnet/subscriptions.hpp"

namespace gimnet::tool {
namespace {

void print(ToolSession& session, const Message& message, const Absent& absent) {
  Output& output = session.output();
  if (session.options().raw) {
    output.write(message.data());
    output.write("\n");
  } else {
    output.write(session.options().json ? json_line(message, absent)
                                        : text_line(message, is_pattern(session.options().target)));
  }
}

/// Tells losses. Those that a full queue or short memory at the hub cost a service are told with
/// its missed messages.
void take_lost(LostMessages& lost, LostCounts counts, const MissedMessages* missed) {
  if (missed != nullptr) counts.queue_full = counts.over_budget = 0;
  lost.take(counts);
}

void say_all(const std::vector<std::string>& sentences) {
  for (const std::string& sentence : sentences) say(sentence);
}

}  // namespace

std::string text_line(const Message& message, bool named) {
  std::string line = named ? std::string(message.service()) + " " : "";
  line += message.from().text() + " ";
  if (message.key() != MessageKey{}) {
    line += std::to_string(message.key().type) + "/" + std::to_string(message.key().instance) + " ";
  }
  return line + "#" + std::to_string(message.sequence()) + ": " + printable(message.text()) + "\n";
}

std::string json_line(const Message& message, const Absent& absent) {
  JsonWriter json;
  json.begin_object().member("from", message.from().text());
  if (!message.service().empty()) json.member("service", message.service());
  json.member("type", message.key().type).member("instance", message.key().instance);
  json.member("sequence", message.sequence()).member("arrival_ns", message.arrival_ns());
  if (const auto sent = message.sent_ns()) {
    json.member("sent_ns", *sent);
    json.member("age_us", static_cast<double>(message.arrival_ns() - *sent) / 1000.0);
  }
  json.member("lost", absent.lost);
  if (absent.missed) json.member("missed", *absent.missed).member("skipped", absent.skipped);
  json.member("size", message.size()).bytes_member("text", message.data()).end_object();
  return json.str() + "\n";
}

ExitCode print_messages(ToolSession& session, const Receive& receive, MissedMessages* missed) {
  const Bounds bounds(session.options());
  ConnectionWatch watch(session.node());
  LostMessages lost;
  std::uint64_t printed = 0;
  Failure failure;
  while (!bounds.enough(printed) && !bounds.late() && !session.stopped()) {
    auto message = receive(kNoWait);
    if (!message && message.is(Status::timeout)) {
      session.output().flush();
      if (!session.output().ok()) break;
      message = receive(bounds.wait(ConnectionWatch::kPeriod));
    }
    const std::int64_t now_ns = steady_now_ns();
    watch.look_now_and_then(now_ns);
    if (message) watch.take(*message);
    const LostCounts counts = session.node().lost();
    if (missed != nullptr) missed->take_lost(counts);
    take_lost(lost, counts, missed);
    say_all(lost.news(now_ns));
    if (missed != nullptr) say_all(missed->news(now_ns));
    if (!message && message.is(Status::timeout)) continue;
    if (!message) {
      failure = message.failure();
      break;
    }
    Absent absent{.lost = lost.all(), .missed = std::nullopt};
    if (missed != nullptr) {
      absent.missed = missed->take(*message);
      absent.skipped = missed->skipped(message->service());
    }
    print(session, *message, absent);
    ++printed;
    if (!session.output().ok()) break;
  }
  watch.look_at_end();  // it may have broken, and be back, since the last look
  take_lost(lost, session.node().lost(), missed);
  say_all(lost.rest());
  if (missed != nullptr) say_all(missed->rest());
  if (!failure.sentence.empty()) return session.fail(failure);
  return session.finish_stream(bounds, printed);
}

namespace {

/// Messages that wait in this process for the reader of its output.
constexpr std::size_t kWaitingMessages = 4096;

}  // namespace

ExitCode run_recv(ToolSession& session) {
  const ToolOptions& options = session.options();
  NodeOptions how;
  how.name = options.name;
  how.message_bytes_max = options.bytes_max;
  if (const auto ending = session.join(how)) return *ending;
  const Queue queue =
      session.node().queue(options.key, {kWaitingMessages, AtFullQueue::stop_reading});
  say("receiving as " + options.name + " (" + session.node().peer().text() + ")");
  return print_messages(session, [&](Timeout timeout) { return queue.receive(timeout); });
}

ExitCode run_echo(ToolSession& session) {
  if (const auto ending = session.join({})) return *ending;
  // As many wait as the library chooses: of a service with delivery `latest` only the newest.
  SubscribeOptions wish = session.options().wish;
  wish.at_full = AtFullQueue::stop_reading;
  Subscriptions subscriptions(session.node(), session.options().target, wish);
  // A user that asks for less than all has gaps on purpose.
  const bool all = !wants_less(wish);
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
