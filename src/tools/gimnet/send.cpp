#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <utility>

#include "base/clock.hpp"
#include "tools/gimnet/input.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/losses.hpp"
#include "tools/gimnet/output.hpp"
#include "tools/gimnet/session.hpp"
#include "tools/gimnet/table.hpp"

namespace gimnet::tool {
namespace {

/// Messages of one call that may wait for their ACK.
constexpr std::size_t kWindow = 64;
/// The largest message that any node can take.
constexpr std::size_t kMessageBytesMax = std::size_t{1} << 30;
/// The wait for acknowledgements of which nothing is said.
constexpr Timeout kSilentWait{2'000};

/// So that a wrong name is known before anything else is done.
Outcome<void> check_readable(const std::string& path) {
  if (path.empty() || ::access(path.c_str(), R_OK) == 0) return {};
  return cannot_read(path, errno);
}

/// Two ways to one stream.
struct TargetSenders {
  Sender sender;   ///< is told when the service is away
  Sender patient;  ///< waits for a service that is away
};

Outcome<TargetSenders> open_target(ToolSession& session, bool is_service, Peer peer) {
  SendOptions stream;
  stream.key = session.options().key;
  stream.lane = session.options().lane;
  stream.window = kWindow;
  stream.end_at_loss = true;
  const auto open = [&] {
    return is_service ? session.node().sender(session.options().target, stream)
                      : session.node().sender(peer, stream);
  };
  auto sender = open();
  if (!sender) return sender.failure();
  stream.wait_if_away = true;
  auto patient = open();
  if (!patient) return patient.failure();
  return TargetSenders{std::move(*sender), std::move(*patient)};
}

/// A call with less time than kForever would not do: of a message that goes in pieces it leaves the
/// rest to the library, and answers as if all were sent.
Outcome<void> send_one(const TargetSenders& target, BytesView message, More more) {
  auto sent = target.sender.send(message, kForever, more);
  if (sent.is(Status::not_found)) {
    const std::string& why = sent.failure().sentence;
    if (why.find(" is away") != std::string::npos) {
      say(why.substr(why.find(": ") + 2) + "; waiting for it");
      sent = target.patient.send(message, kForever, more);
    }
  }
  if (sent || sent.failure().status != Status::too_large || message.size() > kMessageBytesMax)
    return sent;
  return Failure{Status::too_large,
                 sent.failure().sentence + " (`gimnet recv` takes larger ones with --max-size)"};
}

/// Waits for the fate of all messages. If that takes long, it says for whom it waits.
Outcome<void> settle(const Sender& sender, const std::string& target) {
  auto settled = sender.settle(kSilentWait);
  if (settled || !settled.is(Status::timeout)) return settled;
  const std::uint64_t waiting = sender.counts().waiting;
  say("waiting for " + target + " to acknowledge " + std::to_string(waiting) +
      (waiting == 1 ? " message" : " messages"));
  return sender.settle();
}

Outcome<void> send_file(const TargetSenders& target, const ToolOptions& options) {
  const std::string& path = options.file;
  const auto content = FileContent::read(path, kMessageBytesMax);
  if (!content) return content.failure();
  const std::int64_t begin_ns = steady_now_ns();
  const ProgressLine progress([&] {
    return "sending " + path + ", " + byte_count(static_cast<double>(content->bytes().size())) +
           ": " + std::to_string((steady_now_ns() - begin_ns) / 1'000'000'000) + " s";
  });
  if (auto sent = send_one(target, content->bytes(), More::no); !sent) return sent;
  return settle(target.sender, options.target);
}

/// The part of the input that was not sent.
enum class Unsent : std::uint8_t { nothing, rest, line_and_rest };

/// Waits for the fate of what was sent before a loss, or before a message that could not be sent,
/// and answers with that.
Outcome<void> settle_before(const Sender& sender, Outcome<void> unsent) {
  auto settled = sender.settle();
  if (!unsent && sender.counts().lost == 0) return unsent;
  return settled ? Failure{Status::not_delivered, "messages were lost"} : settled;
}

Outcome<void> send_lines(ToolSession& session, const TargetSenders& target, Unsent& unsent) {
  const Sender& sender = target.sender;
  ConnectionWatch watch(session.node());
  LineInput input(STDIN_FILENO, session.stop().descriptor(),
                  [&] { return watch.goes_on() && sender.counts().lost == 0; });
  unsent = Unsent::rest;
  const ProgressLine progress([&] {
    const SendCounts counts = sender.counts();
    return std::to_string(counts.sent) + " sent, " + std::to_string(counts.acknowledged) +
           " acknowledged";
  });
  std::string_view line;
  for (;;) {
    switch (input.next(line)) {
      case LineInput::State::line:
        if (auto sent = send_one(target, line, input.has_line() ? More::yes : More::no); !sent) {
          if (sender.counts().lost == 0) unsent = Unsent::line_and_rest;
          return settle_before(sender, std::move(sent));
        }
        break;
      case LineInput::State::failed:
        return cannot_read("standard input", input.error());
      case LineInput::State::given_up:
        return sender.counts().lost != 0 ? settle_before(sender, {}) : ToolSession::gone();
      case LineInput::State::stopped:
        return {};
      case LineInput::State::end:
        unsent = Unsent::nothing;
        return {};
    }
  }
}

void print(ToolSession& session, const SendCounts& counts) {
  if (!session.options().json) return;
  JsonWriter json;
  json.begin_object().member("sent", counts.sent).member("acknowledged", counts.acknowledged);
  json.member("lost", counts.lost).member("waiting", counts.waiting).end_object();
  session.output().write(json.str() + "\n");
}

std::string acknowledged_words(const SendCounts& counts) {
  return std::to_string(counts.acknowledged) + (counts.acknowledged == 1 ? " was" : " were");
}

/// Why not all arrived: what the stream knows says more than the call that failed after it. The
/// stream calls a node by its id, and the user by the name that was given.
Failure reason(const ToolSession& session, const Peer& peer, const SendCounts& counts,
               Unsent unsent, Failure failure) {
  const std::string& target = session.options().target;
  const std::string to_id = "cannot send to " + peer.text() + ":";
  if (failure.sentence.starts_with(to_id))
    failure.sentence.replace(0, to_id.size(), "cannot send to " + target + ":");
  if (counts.lost == 0) {
    if (unsent == Unsent::line_and_rest) {
      failure.sentence += "; of " + std::to_string(counts.sent) + " messages before it " +
                          acknowledged_words(counts) +
                          " acknowledged, and nothing behind it was sent";
    }
    return failure;
  }
  if (counts.loss_reason == LossReason::connection_lost)
    return {Status::not_connected, failure.sentence};
  return {Status::not_delivered,
          std::to_string(counts.lost) + " of " + std::to_string(counts.sent) +
              " messages were not acknowledged by " + target + ": " + loss_words(counts, target) +
              "; " + acknowledged_words(counts) +
              (unsent == Unsent::nothing ? "" : ", and the rest of the input was not sent")};
}

/// It was the id of nobody, or a service that was withdrawn: as a name that nobody has.
bool nobody_there(const SendCounts& counts) {
  if (counts.acknowledged != 0) return false;
  switch (counts.loss_reason) {
    case LossReason::no_such_node:
    case LossReason::no_route:
    case LossReason::no_such_group:
    case LossReason::service_gone:
      return true;
    default:
      return false;
  }
}

}  // namespace

ExitCode run_send(ToolSession& session) {
  const ToolOptions& options = session.options();
  if (const auto readable = check_readable(options.file); !readable)
    return session.fail(readable.failure());
  NodeOptions how;
  how.name = options.name;
  // A message whose fate is not known counts as lost: only the same session can tell it.
  how.reconnect = false;
  how.resume = true;
  if (const auto ending = session.join(how)) return *ending;
  // A node of that name goes first.
  const bool to_service =
      session.is_service(options.target) && !session.node().find(options.target);
  const auto peer = to_service ? std::optional(Peer{}) : session.find(options.target);
  if (!peer) return session.code();
  const auto target = open_target(session, to_service, *peer);
  if (!target) return session.fail(target.failure());
  Unsent unsent = Unsent::nothing;
  auto sent =
      options.file.empty() ? send_lines(session, *target, unsent) : send_file(*target, options);
  if (sent && !session.stopped()) sent = settle(target->sender, options.target);
  const SendCounts counts = target->sender.counts();
  print(session, counts);
  if (sent) return session.finish();
  session.output().flush();
  const ExitCode code = session.fail(reason(session, *peer, counts, unsent, sent.failure()));
  if (session.stopped()) return code;
  if (code == ExitCode::no_connection) {
    say(std::to_string(counts.acknowledged) + " of " + std::to_string(counts.sent) +
        " messages were acknowledged" +
        (unsent == Unsent::nothing ? "" : ", and the rest of the input was not sent"));
    return code;
  }
  if (counts.acknowledged == 0 && counts.loss_reason == LossReason::not_allowed)
    return ExitCode::denied;
  return nobody_there(counts) ? ExitCode::not_found : ExitCode::failed;
}

}  // namespace gimnet::tool
