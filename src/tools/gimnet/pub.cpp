#include <unistd.h>

#include <cmath>
#include <cstring>

#include "base/clock.hpp"
#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/connection_watch.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/line_input.hpp"
#include "tools/gimnet/progress.hpp"

namespace gimnet::tool {
namespace {

/// How long the last lines may take to leave.
constexpr Timeout kDrain{10'000};
/// How often somebody who waits for nothing but a signal looks at the connection.
constexpr std::int64_t kLookNs = 200'000'000;
/// Lines that come without a pause; after so many the connection is looked at.
constexpr std::uint64_t kLinesPerLook = 1'000;

Outcome<void> publish_lines(Session& session, const Publisher& publisher) {
  const double rate = session.options().rate_hz;
  const auto period_ns = rate > 0.0 ? static_cast<std::int64_t>(std::llround(1e9 / rate)) : 0;
  std::int64_t next_ns = steady_now_ns();
  ConnectionWatch watch(session.node());
  LineInput input(STDIN_FILENO, session.stop().descriptor(), [&] { return watch.goes_on(); });
  const Progress progress([&] {
    return std::to_string(publisher.published()) + " published to " + std::to_string(publisher.subscribers());
  });
  std::string_view line;
  for (;;) {
    switch (input.next(line)) {
      case LineInput::State::line:
        // Lines may come while there is no hub: that is said, and they go on when it is back.
        if ((!input.has_line() || publisher.published() % kLinesPerLook == 0) && !watch.goes_on()) {
          return Session::gone();
        }
        if (period_ns != 0 && !session.stop().wait_until(next_ns)) return {};
        next_ns += period_ns;
        if (auto sent = publisher.publish(line, period_ns == 0 && input.has_line() ? More::yes : More::no); !sent) {
          return sent;
        }
        break;
      case LineInput::State::failed:
        return Failure{Status::system, std::string("cannot read standard input: ") + std::strerror(input.error())};
      case LineInput::State::given_up:
        return Session::gone();
      case LineInput::State::stopped:
      case LineInput::State::end:
        return {};
    }
  }
}

/// The service stands, and with it what is retained, until a signal comes or the hub wants this node no more.
Outcome<void> stay(Session& session) {
  session.output().flush();
  say("the input has ended; the service stays until Ctrl-C");
  ConnectionWatch watch(session.node());
  while (session.stop().wait_until(steady_now_ns() + kLookNs)) {
    if (!watch.goes_on()) return Session::gone();
  }
  return {};
}

void write_counts(Session& session, const Publisher& publisher) {
  if (!session.options().json) return;
  JsonWriter json;
  json.begin_object().member("published", publisher.published()).member("subscribers", publisher.subscribers());
  session.output().write(json.end_object().str() + "\n");
}

}  // namespace

ExitCode run_pub(Session& session) {
  const Options& options = session.options();
  const std::size_t middle = options.target.rfind('/');
  NodeOptions how;
  how.name = options.target.substr(0, middle);
  if (const auto ending = session.join(how)) return *ending;
  PublishOptions service;
  service.delivery = options.delivery;
  service.window = options.window;
  service.retain = options.retain;
  service.lane = options.lane;
  service.key = options.key;
  const auto publisher = session.node().advertise(options.target.substr(middle + 1), service);
  if (!publisher) return session.fail(publisher.failure());
  if (options.subscribers > publisher->subscribers()) {
    say("waiting for " + std::to_string(options.subscribers) +
        (options.subscribers == 1 ? " subscriber of " : " subscribers of ") + options.target);
    if (auto waited = publisher->wait_for_subscribers(options.subscribers); !waited) {
      return session.fail(waited.failure());
    }
  }
  auto sent = publish_lines(session, *publisher);
  if (sent && !session.stopped()) sent = session.node().drain(kDrain);
  write_counts(session, *publisher);
  if (sent && options.stay && !session.stopped()) sent = stay(session);
  if (!sent) return session.fail(sent.failure());
  return session.finish();
}

}  // namespace gimnet::tool
