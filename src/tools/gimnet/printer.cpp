#include "tools/gimnet/printer.hpp"

#include <string>

#include "tools/gimnet/json_writer.hpp"

namespace gimnet::tool {
namespace {

constexpr Timeout kLookAtConnection{500};

/// Control characters would let a message write over the terminal.
std::string printable(std::string_view text) {
  std::string shown;
  for (const char letter : text) {
    const auto code = static_cast<unsigned char>(letter);
    shown += code < 0x20 || code == 0x7F ? '.' : letter;
  }
  return shown;
}

void print(Session& session, const Message& message) {
  Output& output = session.output();
  if (session.options().raw) {
    output.write(message.data());
    output.write("\n");
  } else {
    output.write(session.options().json ? json_line(message) : text_line(message));
  }
}

/// Tells breaks of the connection to the user, once each.
class ConnectionWatch {
 public:
  explicit ConnectionWatch(Node& node) : node_(node) {}
  void look() {
    const NodeState state = node_.state();
    if (state.connected == connected_ || !state.peer) return;
    connected_ = state.connected;
    say(connected_ ? "connected again as " + state.peer.text()
                   : "the connection broke (" + state.trouble + "); trying to connect again");
  }

 private:
  Node& node_;
  bool connected_ = true;
};

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

ExitCode print_messages(Session& session, const Queue& queue) {
  const std::uint64_t count = session.options().count;
  ConnectionWatch watch(session.node());
  for (std::uint64_t printed = 0; count == 0 || printed < count;) {
    auto waiting = queue.try_receive();
    if (!waiting) {
      session.output().flush();
      if (!session.output().ok()) break;
      auto received = queue.receive(kLookAtConnection);
      if (!received && !received.is(Status::timeout)) return session.fail(received.failure());
      if (!received) {
        watch.look();
        continue;
      }
      waiting = std::move(*received);
    }
    print(session, *waiting);
    ++printed;
    if (!session.output().ok() || session.stopped()) break;
  }
  return session.finish();
}

}  // namespace gimnet::tool
