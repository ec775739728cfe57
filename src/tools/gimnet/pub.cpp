#include <unistd.h>

#include <cmath>
#include <cstring>

#include "base/clock.hpp"
#include "tools/gimnet/commands.hpp"
#include "tools/gimnet/connection_watch.hpp"
#include "tools/gimnet/line_input.hpp"
#include "tools/gimnet/progress.hpp"

namespace gimnet::tool {
namespace {

/// How long the last lines may take to leave.
constexpr Timeout kDrain{10'000};

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
  if (!sent) return session.fail(sent.failure());
  return session.finish();
}

}  // namespace gimnet::tool
