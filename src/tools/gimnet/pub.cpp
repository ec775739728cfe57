#include "tools/gimnet/pub.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/clock.hpp"
#include "tools/gimnet/input.hpp"
#include "tools/gimnet/json_writer.hpp"
#include "tools/gimnet/output.hpp"
#include "tools/gimnet/session.hpp"

namespace gimnet::tool {

std::string UnheardLines::sentence(const std::string& service, bool waited) const {
  if (unheard_ == 0) return {};
  const std::string all = std::to_string(lines_);
  std::string count = std::to_string(unheard_) + " of " + all + " lines went to nobody: ";
  if (unheard_ == lines_)
    count = lines_ == 1 ? "the line went to nobody: " : "all " + all + " lines went to nobody: ";
  if (waited) return count + "the last subscriber of " + service + " had left";
  return count + "nobody had subscribed to " + service +
         " then; --wait 1 holds the first until somebody has";
}

namespace {

/// The last lines may take this long to leave.
constexpr Timeout kDrain{10'000};
/// The hub may take this long to say what it knows already.
constexpr Timeout kMissedAnswer{500};
/// The library may take this long to say why.
constexpr std::int64_t kWhyNs = 1'000'000'000;
/// The time between two looks at the connection.
constexpr std::int64_t kLookNs = 200'000'000;
/// The time until a look after a line that found no connection.
constexpr std::int64_t kSoonNs = 10'000'000;

/// A connection without which nothing goes on: looks now and then, says what it sees, and waits if
/// there is none, since publishing would wait without a word.
class Standing {
 public:
  Standing(ToolSession& session, const Publisher& publisher)
      : session_(session), publisher_(publisher), watch_(session.node()) {}

  /// False: none will come any more, or a signal came; outcome() says which.
  [[nodiscard]] bool stands() {
    while (steady_now_ns() >= next_look_ns_) {
      next_look_ns_ = steady_now_ns() + kLookNs;
      if (!goes_on()) return false;
      if (session_.node().state().connected) return true;
      if (!session_.stop().wait_until(next_look_ns_)) return false;
    }
    return true;
  }
  /// False: a signal came before `deadline_ns`, or as stands().
  [[nodiscard]] bool stands_until(std::int64_t deadline_ns) {
    while (stands()) {
      if (steady_now_ns() >= deadline_ns) return true;
      if (!session_.stop().wait_until(std::min(deadline_ns, next_look_ns_))) return false;
    }
    return false;
  }
  /// The connection broke after the last look: waits for another one, as stands().
  [[nodiscard]] bool stands_again() {
    next_look_ns_ = steady_now_ns() + kSoonNs;
    return session_.stop().wait_until(next_look_ns_) && stands();
  }
  /// The hub wants this node and has its service; looks at once.
  [[nodiscard]] bool goes_on() { return watch_.goes_on() && publisher_.standing(); }
  /// Why it did not stand: a signal is no failure.
  [[nodiscard]] Outcome<void> outcome() const {
    if (session_.stopped()) return {};
    if (!session_.node().state().ended) {
      if (auto stands = publisher_.standing(); !stands) return stands;
    }
    return ToolSession::gone();
  }

 private:
  ToolSession& session_;
  const Publisher& publisher_;
  ConnectionWatch watch_;
  std::int64_t next_look_ns_ = 0;
};

/// Says, once, that those who subscribe later do not get the last line.
class Retaining {
 public:
  void look_at(const Outcome<void>& retained) {
    if (!retained.is(Status::not_retained) || told_) return;
    told_ = true;
    say(retained.failure().sentence);
  }

 private:
  bool told_ = false;
};

/// A publisher may hear that the service was refused a moment before the library says why.
Outcome<void> why_refused(ToolSession& session, const Publisher& publisher,
                          const Outcome<void>& sent) {
  const std::int64_t end_ns = steady_now_ns() + kWhyNs;
  while (!session.node().state().ended && steady_now_ns() < end_ns) {
    if (auto stands = publisher.standing(); !stands) return stands;
    if (!session.stop().wait_until(steady_now_ns() + kWhyNs / 100)) break;
  }
  return sent;
}

/// Publishes a line, once there is a connection.
Outcome<void> publish_line(const Publisher& publisher, std::string_view line, More more,
                           Standing& standing) {
  for (;;) {
    auto sent = publisher.publish(line, kForever, more);
    if (!sent.is(Status::not_connected)) return sent;
    if (!standing.stands_again()) return standing.outcome();
  }
}

Outcome<void> publish_lines(ToolSession& session, const Publisher& publisher, Standing& standing,
                            UnheardLines& unheard, Retaining& retaining) {
  const double rate = session.options().rate_hz;
  const auto period_ns = rate > 0.0 ? static_cast<std::int64_t>(std::llround(1e9 / rate)) : 0;
  std::int64_t next_ns = steady_now_ns();
  LineInput input(STDIN_FILENO, session.stop().descriptor(), [&] { return standing.goes_on(); });
  const ProgressLine progress([&] {
    return std::to_string(publisher.published()) + " published to " +
           std::to_string(publisher.subscribers());
  });
  std::string_view line;
  for (;;) {
    switch (input.next(line)) {
      case LineInput::State::line:
        if (!standing.stands_until(next_ns)) return standing.outcome();
        // After a pause of the input or the hub, no burst catches up with the rate.
        next_ns = std::max(next_ns + period_ns, steady_now_ns() - kLookNs);
        unheard.before_line(publisher.subscribers());
        if (auto sent =
                publish_line(publisher, line,
                             period_ns == 0 && input.has_line() ? More::yes : More::no, standing);
            sent.is(Status::not_retained)) {
          retaining.look_at(sent);
        } else if (!sent) {
          return sent.is(Status::refused) ? why_refused(session, publisher, sent) : sent;
        }
        unheard.after_line(publisher.subscribers());
        break;
      case LineInput::State::failed:
        return Failure{Status::system,
                       std::string("cannot read standard input: ") + std::strerror(input.error())};
      case LineInput::State::given_up:
        return standing.outcome();
      case LineInput::State::stopped:
      case LineInput::State::end:
        return {};
    }
  }
}

Outcome<void> wait_for_subscribers(const ToolSession& session, const Publisher& publisher,
                                   Standing& standing) {
  const std::size_t wanted = session.options().subscribers;
  if (publisher.subscribers() >= wanted) return {};
  say("waiting for " + std::to_string(wanted) +
      (wanted == 1 ? " subscriber of " : " subscribers of ") + session.options().target);
  while (true) {
    auto waited = publisher.wait_for_subscribers(wanted, Timeout{kLookNs / 1'000'000});
    if (waited || waited.failure().status != Status::timeout) return waited;
    if (!standing.goes_on()) return standing.outcome();
  }
}

/// Waits until the last lines have left. What a break cost that is over is no failure of this one.
Outcome<void> drain(ToolSession& session) {
  auto drained = session.node().drain(kDrain);
  if (!drained.is(Status::not_connected) || !session.node().state().connected) return drained;
  say(drained.failure().sentence);
  return session.node().drain(kDrain);
}

/// Says what the hub knows now of messages that subscribers missed. Their libraries tell it once a
/// second, for which nobody waits.
void tell_missed(ToolSession& session) {
  const ToolOptions& options = session.options();
  // The hub counts those of `latest` too that a newer one replaced, as it should be.
  if (options.delivery == Delivery::latest) return;
  const auto services = session.node().services(options.target, kMissedAnswer);
  if (!services || services->empty() || services->front().missed == 0) return;
  say("subscribers missed " + std::to_string(services->front().missed) +
      " or more: they read more slowly than this publishes (--rate HZ helps), or a link broke");
}

/// The service stands, and with it what is retained, until a signal comes or the hub wants this
/// node no more.
Outcome<void> stay(ToolSession& session, const Publisher& publisher, Standing& standing,
                   Retaining& retaining) {
  session.output().flush();
  say("the input has ended; the service stays until Ctrl-C");
  while (session.stop().wait_until(steady_now_ns() + kLookNs)) {
    // The hub's word on the last message may come after the message was taken.
    retaining.look_at(publisher.retained());
    if (!standing.goes_on()) break;
  }
  return standing.outcome();
}

void write_counts(ToolSession& session, const Publisher& publisher) {
  if (!session.options().json) return;
  JsonWriter json;
  json.begin_object()
      .member("published", publisher.published())
      .member("subscribers", publisher.subscribers());
  session.output().write(json.end_object().str() + "\n");
}

}  // namespace

ExitCode run_pub(ToolSession& session) {
  const ToolOptions& options = session.options();
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
  Standing standing(session, *publisher);
  auto sent = wait_for_subscribers(session, *publisher, standing);
  UnheardLines unheard;
  Retaining retaining;
  if (sent && !session.stopped())
    sent = publish_lines(session, *publisher, standing, unheard, retaining);
  if (sent && !session.stopped()) sent = drain(session);
  retaining.look_at(publisher->retained());
  // A retained line is for those that come later.
  const std::string unheard_words = unheard.sentence(options.target, options.subscribers > 0);
  if (sent && !session.stopped() && !options.retain && !unheard_words.empty()) say(unheard_words);
  if (sent && !session.stopped()) tell_missed(session);
  write_counts(session, *publisher);
  if (sent && options.stay && !session.stopped())
    sent = stay(session, *publisher, standing, retaining);
  if (!sent) return session.fail(sent.failure());
  return session.finish();
}

}  // namespace gimnet::tool
