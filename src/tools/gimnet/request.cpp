#include <string>

#include "gimnet/gimi.hpp"
#include "tools/gimnet/input.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/session.hpp"

// gimnet request and gimnet answer.

namespace gimnet::tool {
namespace {

std::string line_of(const Reply& reply, const ToolOptions& options) {
  if (options.raw) return std::string(reply.text()) + "\n";
  if (!options.json) return printable(reply.text()) + "\n";
  JsonWriter json;
  json.begin_object().member("from", reply.from().text()).member("size", reply.data().size());
  json.bytes_member("text", reply.data()).end_object();
  return json.str() + "\n";
}

/// Answers one request after the other, until there were enough of them.
Outcome<void> echo_requests(ToolSession& session, const Answers& answers) {
  ConnectionWatch watch(session.node());
  const std::uint64_t count = session.options().count;
  for (std::uint64_t answered = 0; count == 0 || answered < count;) {
    if (session.stopped()) return {};
    auto request = answers.receive(ConnectionWatch::kPeriod);
    if (!request && !request.is(Status::timeout)) return request.failure();
    if (!request && !watch.goes_on()) return ToolSession::gone();
    if (!request) continue;
    // One that has gone meanwhile costs the others nothing.
    if (const auto sent = request->reply(request->data()); !sent) say(sent.failure().sentence);
    ++answered;
  }
  return {};
}

}  // namespace

ExitCode run_request(ToolSession& session) {
  const ToolOptions& options = session.options();
  Outcome<FileContent> file{FileContent{}};
  if (!options.file.empty()) file = FileContent::read(options.file, std::size_t{1} << 30);
  if (!file) return session.fail(file.failure());
  if (const auto ending = session.join({})) return *ending;
  const BytesView data = options.file.empty() ? BytesView(options.text) : BytesView(file->bytes());
  const Timeout timeout{static_cast<std::int64_t>(options.timeout_s * 1000)};
  const Reply reply = session.node().request(options.target, data, timeout, {.lane = options.lane});
  if (reply.is(Status::not_found)) return session.fail_unknown_service(reply.failure().sentence);
  if (!reply) return session.fail(reply.failure());
  session.output().write(line_of(reply, options));
  return session.finish();
}

ExitCode run_answer(ToolSession& session) {
  const std::string& target = session.options().target;
  const auto slash = target.rfind('/');
  if (const auto ending = session.join({.name = target.substr(0, slash)})) return *ending;
  const auto answers = session.node().answer(target.substr(slash + 1));
  if (!answers) return session.fail(answers.failure());
  say("answering " + target + " (" + session.node().peer().text() + ")");
  const auto ended = echo_requests(session, *answers);
  return ended ? session.finish() : session.fail(ended.failure());
}

}  // namespace gimnet::tool
