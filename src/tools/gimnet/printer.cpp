#include "tools/gimnet/printer.hpp"

#include <string>

#include "tools/gimnet/bounds.hpp"
#include "tools/gimnet/connection_watch.hpp"
#include "tools/gimnet/json_writer.hpp"

namespace gimnet::tool {
namespace {

constexpr Timeout kLookAtConnection{500};

void print(Session& session, const Message& message) {
  Output& output = session.output();
  if (session.options().raw) {
    output.write(message.data());
    output.write("\n");
  } else {
    output.write(session.options().json ? json_line(message) : text_line(message));
  }
}

}  // namespace

std::string text_line(const Message& message) {
  std::string line = message.from().text() + " ";
  if (message.key() != MessageKey{}) {
    line += std::to_string(message.key().type) + "/" + std::to_string(message.key().instance) + " ";
  }
  return line + "#" + std::to_string(message.sequence()) + ": " + printable(message.text()) + "\n";
}

std::string json_line(const Message& message) {
  JsonWriter json;
  json.begin_object().member("from", message.from().text());
  if (!message.service().empty()) json.member("service", message.service());
  json.member("type", message.key().type).member("instance", message.key().instance);
  json.member("sequence", message.sequence()).member("arrival_ns", message.arrival_ns());
  if (const auto sent = message.sent_ns()) {
    json.member("sent_ns", *sent);
    json.member("age_us", static_cast<double>(message.arrival_ns() - *sent) / 1000.0);
  }
  json.member("size", message.size()).bytes_member("text", message.data()).end_object();
  return json.str() + "\n";
}

ExitCode print_messages(Session& session, const Receive& receive) {
  const Bounds bounds(session.options());
  ConnectionWatch watch(session.node());
  std::uint64_t printed = 0;
  while (!bounds.enough(printed) && !bounds.late() && !session.stopped()) {
    auto message = receive(kNoWait);
    if (!message && message.is(Status::timeout)) {
      session.output().flush();
      if (!session.output().ok()) break;
      message = receive(bounds.wait(kLookAtConnection));
    }
    if (!message && message.is(Status::timeout)) {
      watch.look();
      continue;
    }
    if (!message) return session.fail(message.failure());
    print(session, *message);
    ++printed;
    if (!session.output().ok()) break;
  }
  return session.finish_stream(bounds, printed);
}

}  // namespace gimnet::tool
