#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "base/clock.hpp"
#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/connection_watch.hpp"
#include "tools/gimnet/decimal.hpp"
#include "tools/gimnet/file_content.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/line_input.hpp"
#include "tools/gimnet/loss_words.hpp"
#include "tools/gimnet/progress.hpp"

namespace gimnet::tool {
namespace {

/// Messages of one call that may wait for their ACK.
constexpr std::size_t kWindow = 64;
/// The largest message that any node can take.
constexpr std::size_t kMessageBytesMax = std::size_t{1} << 30;

/// So that a wrong name is known before anything else is done.
Outcome<void> check_readable(const std::string& path) {
  if (path.empty() || ::access(path.c_str(), R_OK) == 0) return {};
  return cannot_read(path, errno);
}

Outcome<void> send_file(const Sender& sender, const std::string& path) {
  const auto content = FileContent::read(path, kMessageBytesMax);
  if (!content) return content.failure();
  const std::int64_t begin_ns = steady_now_ns();
  const Progress progress([&] {
    return "sending " + path + ", " + byte_count(static_cast<double>(content->bytes().size())) + ": " +
           std::to_string((steady_now_ns() - begin_ns) / 1'000'000'000) + " s";
  });
  if (auto sent = sender.send(content->bytes()); !sent) return sent;
  return sender.settle();
}

/// Waits for the fate of what was sent before a loss, and answers with the loss.
Outcome<void> settle_loss(const Sender& sender) {
  auto settled = sender.settle();
  return settled ? Failure{Status::not_delivered, "messages were lost"} : settled;
}

/// `rest`: input is left that was not sent.
Outcome<void> send_lines(Session& session, const Sender& sender, bool& rest) {
  ConnectionWatch watch(session.node());
  LineInput input(STDIN_FILENO, session.stop().descriptor(),
                  [&] { return watch.goes_on() && sender.counts().lost == 0; });
  rest = true;
  const Progress progress([&] {
    const SendCounts counts = sender.counts();
    return std::to_string(counts.sent) + " sent, " + std::to_string(counts.acknowledged) + " acknowledged";
  });
  std::string_view line;
  for (;;) {
    switch (input.next(line)) {
      case LineInput::State::line:
        if (auto sent = sender.send(line, kForever, input.has_line() ? More::yes : More::no); !sent) {
          return sender.counts().lost != 0 ? settle_loss(sender) : sent;
        }
        break;
      case LineInput::State::failed:
        return cannot_read("standard input", input.error());
      case LineInput::State::given_up:
        return sender.counts().lost != 0 ? settle_loss(sender) : Session::gone();
      case LineInput::State::stopped:
        return {};
      case LineInput::State::end:
        rest = false;
        return {};
    }
  }
}

void print(Session& session, const SendCounts& counts) {
  if (!session.options().json) return;
  JsonWriter json;
  json.begin_object().member("sent", counts.sent).member("acknowledged", counts.acknowledged);
  json.member("lost", counts.lost).member("waiting", counts.waiting).end_object();
  session.output().write(json.str() + "\n");
}

/// Why not all arrived: what the stream knows says more than the call that failed after it.
Failure reason(const Session& session, const SendCounts& counts, bool rest, Failure failure) {
  if (counts.lost == 0) return failure;
  const std::string& target = session.options().target;
  return {Status::not_delivered,
          std::to_string(counts.lost) + " of " + std::to_string(counts.sent) + " messages were not acknowledged by " +
              target + ": " + loss_words(counts, target) + "; " + std::to_string(counts.acknowledged) +
              (counts.acknowledged == 1 ? " was" : " were") + (rest ? ", and the rest of the input was not sent" : "")};
}

/// It was the id of nobody: as a name that nobody has.
bool nobody_there(const SendCounts& counts) {
  const bool nobody = counts.loss_reason == LossReason::no_such_node || counts.loss_reason == LossReason::no_route;
  return counts.acknowledged == 0 && nobody;
}

}  // namespace

ExitCode run_send(Session& session) {
  const Options& options = session.options();
  if (const auto readable = check_readable(options.file); !readable) return session.fail(readable.failure());
  NodeOptions how;
  how.name = options.name;
  how.reconnect = false;  // a message whose fate is not known counts as lost
  how.resume = false;
  if (const auto ending = session.join(how)) return *ending;
  const auto peer = session.find(options.target);
  if (!peer) return session.code();
  SendOptions stream;
  stream.key = options.key;
  stream.lane = options.lane;
  stream.window = kWindow;
  stream.end_at_loss = true;
  const auto sender = session.node().sender(*peer, stream);
  if (!sender) return session.fail(sender.failure());
  bool rest = false;
  auto sent = options.file.empty() ? send_lines(session, *sender, rest) : send_file(*sender, options.file);
  if (sent && !session.stopped()) sent = sender->settle();
  const SendCounts counts = sender->counts();
  print(session, counts);
  if (sent) return session.finish();
  session.output().flush();
  const ExitCode code = session.fail(reason(session, counts, rest, sent.failure()));
  if (session.stopped()) return code;
  return nobody_there(counts) ? ExitCode::not_found : ExitCode::failed;
}

}  // namespace gimnet::tool
