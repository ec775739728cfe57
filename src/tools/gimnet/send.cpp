#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <vector>

#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/line_input.hpp"

namespace gimnet::tool {
namespace {

/// Messages of one call that may wait for their ACK.
constexpr std::size_t kWindow = 64;

Failure cannot_read(const std::string& what, int error) {
  return {Status::system, "cannot read " + what + ": " + std::strerror(error)};
}

Outcome<std::vector<char>> read_file(const std::string& path) {
  constexpr std::size_t kReadBytes = std::size_t{1} << 20;
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return cannot_read(path, errno);
  std::vector<char> content;
  for (;;) {
    const std::size_t size = content.size();
    content.resize(size + kReadBytes);
    const ssize_t count = ::read(file, content.data() + size, kReadBytes);
    const int error = errno;
    content.resize(size + static_cast<std::size_t>(count > 0 ? count : 0));
    if (count > 0 || (count < 0 && error == EINTR)) continue;
    ::close(file);
    if (count < 0) return cannot_read(path, error);
    return content;
  }
}

Outcome<void> send_file(const Sender& sender, const std::string& path) {
  const auto content = read_file(path);
  if (!content) return content.failure();
  return sender.send(std::string_view{content->data(), content->size()});
}

Outcome<void> send_lines(Session& session, const Sender& sender) {
  LineInput input(STDIN_FILENO, session.stop().descriptor());
  std::string_view line;
  for (;;) {
    switch (input.next(line)) {
      case LineInput::State::line:
        if (auto sent = sender.send(line, kForever, input.has_line() ? More::yes : More::no); !sent) return sent;
        break;
      case LineInput::State::failed:
        return cannot_read("standard input", input.error());
      case LineInput::State::stopped:
      case LineInput::State::end:
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
Failure reason(const SendCounts& counts, Failure failure) {
  if (counts.lost == 0) return failure;
  return {Status::not_delivered, std::to_string(counts.lost) + " of " + std::to_string(counts.sent) +
                                     " messages were not acknowledged: " + counts.loss};
}

}  // namespace

ExitCode run_send(Session& session) {
  const Options& options = session.options();
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
  const auto sender = session.node().sender(*peer, stream);
  if (!sender) return session.fail(sender.failure());
  auto sent = options.file.empty() ? send_lines(session, *sender) : send_file(*sender, options.file);
  if (sent && !session.stopped()) sent = sender->settle();
  const SendCounts counts = sender->counts();
  print(session, counts);
  if (sent) return session.finish();
  session.output().flush();
  const ExitCode code = session.fail(reason(counts, sent.failure()));
  return session.stopped() ? code : ExitCode::failed;
}

}  // namespace gimnet::tool
