#include "hub/control/conductor_loop.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <csignal>

#include "base/clock.hpp"
#include "base/log.hpp"
#include "hub/control/acceptor.hpp"
#include "hub/control/event_turns.hpp"
#include "hub/control/log_peer.hpp"
#include "hub/control/waiting_room.hpp"

namespace gimnet::hub {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;
using std::chrono::milliseconds;
using Descriptor = asio::posix::stream_descriptor;

constexpr milliseconds kCollectEvery{20};
/// Of events, before strangers and timers have a turn: many listings take longer than many others.
constexpr milliseconds kBatchMost{5};
/// The shards end by themselves at the deadline of DrainCommand; this is for one that does not.
constexpr milliseconds kDrainMargin{1'000};

milliseconds now() { return milliseconds{steady_now_ns() / 1'000'000}; }

/// Waits for a descriptor that somebody else owns.
class DescriptorWatch {
 public:
  DescriptorWatch(asio::io_context& context, int descriptor) : descriptor_(context, descriptor) {}
  ~DescriptorWatch() { descriptor_.release(); }
  DescriptorWatch(const DescriptorWatch&) = delete;
  DescriptorWatch& operator=(const DescriptorWatch&) = delete;

  template <class Then>
  void wait(Then then) {
    descriptor_.async_wait(Descriptor::wait_read, [then](const error_code& error) {
      if (!error) then();
    });
  }

 private:
  Descriptor descriptor_;
};

}  // namespace

struct ConductorLoop::Impl {
  /// A listener, and what wakes it.
  struct Door {
    Door(asio::io_context& context, std::unique_ptr<Listener> listener, const Wiring& wiring,
         DescriptorReserve& reserve, Acceptor::MakeRoom make_room)
        : acceptor(std::move(listener), wiring.limits, wiring.refusals, reserve,
                   std::move(make_room)),
          watch(context, acceptor.listener().descriptor()),
          pause(context) {}
    Acceptor acceptor;
    DescriptorWatch watch;
    asio::steady_timer pause;
  };

  Impl(const Wiring& parts, std::vector<std::unique_ptr<Listener>> listeners)
      : wiring(parts),
        reserve(parts.limits),
        strangers(
            parts.limits,
            [this](Stranger& stranger, const proto::Hello& hello) {
              return admit(stranger, hello);
            },
            parts.refusals),
        strangers_watch(context, strangers.descriptor()),
        inbox_watch(context, parts.inbox.waker().descriptor()),
        dialler_watch(context, parts.dialler.waker().descriptor()),
        timer(context),
        signals(context, SIGTERM, SIGINT),
        reloads(context, SIGHUP) {
    for (auto& listener : listeners) {
      doors.push_back(
          std::make_unique<Door>(context, std::move(listener), parts, reserve,
                                 [this](const Stranger& newcomer) { return make_room(newcomer); }));
    }
  }

  void watch_door(Door& door) {
    door.watch.wait([this, &door] { open(door); });
  }

  void open(Door& door) {
    if (stopping) return;
    look_whether_it_stood();
    const milliseconds moment = now();
    const auto after = door.acceptor.accept_some(
        [this, moment](Stranger stranger) { strangers.enter(std::move(stranger), moment); });
    see_off_leaving();
    tell_rest();  // a newcomer that finds no room has those served who said HELLO
    arm_timer();
    if (stopping) return;  // a newcomer's HELLO had this hub begin anew: the door is gone
    if (after == Acceptor::After::wait) return watch_door(door);
    door.pause.expires_after(milliseconds{Acceptor::kPauseMs});
    door.pause.async_wait([this, &door](const error_code& error) {
      if (!error) open(door);
    });
  }

  /// The ends of connections that the shards told before this HELLO was sent hold already, however
  /// much else they told: a name that was given back is free.
  std::optional<proto::Goodbye> admit(Stranger& stranger, const proto::Hello& hello) {
    // Draining ends in take_events().
    if (!stopping) {
      take_present();
      for (ShardEvent& event : turns.take_ended())
        wiring.conductor.on_event(std::move(event), now());
    }
    return wiring.conductor.admit(stranger, hello, {now(), wall_now_ns()});
  }

  /// Gives the events that shards have handed over their turns. Peers to be seen off wait in
  /// `leaving`: the waiting room may be busy with a stranger.
  void take_present() {
    wiring.inbox.drain_present([this](ShardEvent&& event) {
      if (auto* farewell = std::get_if<FarewellEvent>(&event.what)) {
        leaving.push_back(std::move(farewell->transport));
      } else {
        turns.put(std::move(event));
      }
    });
    if (const auto hub = turns.take_overrun()) {
      wiring.refusals.links_overrun.add(turns.take_dropped());
      const std::string name = std::to_string(hub->value());
      log_seldom(LogLevel::warning, {"overrun", name},
                 "link to hub " + name +
                     ": says more to this hub than it can work off, and some of it is dropped; the "
                     "link's data is not affected",
                 now());
    }
  }

  /// A stranger that has said HELLO does not make way for others.
  Acceptor::Room make_room(const Stranger& newcomer) {
    serve_strangers();
    return strangers.give_way_to(newcomer);
  }

  void serve_strangers() {
    while (strangers.serve(now())) {
    }
    see_off_leaving();
  }

  void see_off_leaving() {
    for (auto& transport : std::exchange(leaving, {}))
      strangers.see_off(std::move(transport), now());
  }

  void watch_strangers() {
    strangers_watch.wait([this] {
      look_whether_it_stood();
      serve_strangers();
      tell_rest();
      arm_timer();
      end_if_all_left();
      watch_strangers();
    });
  }

  void take_events() {
    look_whether_it_stood();
    wiring.inbox.waker().awake();
    const milliseconds until = now() + kBatchMost;
    take_present();
    for (std::size_t i = 0; i < ControlInbox::kEventsABatch && !turns.empty(); ++i) {
      wiring.conductor.on_event(turns.take(), now());
      if (now() >= until) break;
      // A node that asks now waits for one answer to each other node, not for this batch.
      if (!wiring.inbox.empty()) take_present();
    }
    see_off_leaving();
    tell_rest();
    arm_timer();
    end_if_all_left();
    if (wiring.inbox.empty() && turns.empty()) {
      wiring.inbox.waker().prepare_to_sleep();
      if (wiring.inbox.empty()) {
        inbox_watch.wait([this] {
          wiring.inbox.waker().clear();
          take_events();
        });
        return;
      }
    }
    // Let strangers and timers have a turn before the next batch.
    asio::post(context, [this] { take_events(); });
  }

  /// A dial that ends behind the look wakes this thread, since the mark of the sleeper goes first.
  void take_dialled() {
    wiring.dialler.waker().prepare_to_sleep();
    look_whether_it_stood();
    for (auto& [link, outcome] : wiring.dialler.take_ended())
      wiring.conductor.on_dialled(link, std::move(outcome), now());
    arm_timer();
    dialler_watch.wait([this] {
      wiring.dialler.waker().clear();
      take_dialled();
    });
  }

  /// The rest waits behind strangers, timers and events.
  void tell_rest() {
    if (telling || !wiring.conductor.tell_rest(now())) return;
    telling = true;
    asio::post(context, [this] {
      telling = false;
      tell_rest();
    });
  }

  /// To be called last by all that the conductor took part in.
  void arm_timer() {
    if (wiring.conductor.drain_wanted() && !stopping) begin_drain();
    std::optional<milliseconds> deadline = wiring.conductor.next_deadline();
    const auto sooner = [&deadline](std::optional<milliseconds> other) {
      if (other && (!deadline || *other < *deadline)) deadline = other;
    };
    sooner(strangers.next_deadline());
    if (wiring.conductor.has_garbage()) sooner(now() + kCollectEvery);
    if (!deadline) return;
    sooner(now() + Conductor::kLookEvery);
    // A time in the far past means "at once".
    deadline = std::max(*deadline, now());
    if (armed && *armed <= *deadline) return;
    armed = deadline;
    timer.expires_after(std::max(*deadline - now(), milliseconds{0}) + milliseconds{1});
    timer.async_wait([this](const error_code& error) {
      if (error) return;
      look_whether_it_stood();
      armed.reset();
      wiring.conductor.tick(now());
      strangers.tick(now());
      tell_rest();
      arm_timer();
      end_if_all_left();
    });
  }

  /// Before anything is judged by the clock: what peers sent while the hub stood still lies there
  /// unread.
  void look_whether_it_stood() {
    const milliseconds moment = now();
    if (!armed || moment - *armed <= Conductor::kLookEvery) return;
    const milliseconds stood = moment - std::exchange(*armed, moment);
    wiring.conductor.stood_still(stood, moment);
    strangers.stood_still(stood, moment);
  }

  void watch_signals() {
    signals.async_wait([this](const error_code& error, int number) {
      if (error) return;
      wiring.conductor.want_drain();
      if (stopping) {
        log_warning("second signal: ending without waiting");
        context.stop();
        return;
      }
      log_info(std::string{"signal "} + (number == SIGTERM ? "TERM" : "INT") + ": draining");
      begin_drain();
      watch_signals();
    });
  }

  void watch_reloads() {
    reloads.async_wait([this](const error_code& error, int) {
      if (error) return;
      static_cast<void>(wiring.conductor.reload());
      watch_reloads();
    });
  }

  void begin_drain() {
    stopping = true;
    doors.clear();
    strangers.dismiss_all(
        {proto::GoodbyeCode::draining, "the hub is shutting down; connect to another one"}, now());
    const milliseconds pause = wiring.conductor.announce_end(now());
    if (pause == milliseconds{0}) return drain();
    drain_deadline.emplace(context, pause);
    drain_deadline->async_wait([this](const error_code& error) {
      if (!error) drain();
    });
    arm_timer();
  }

  void drain() {
    wiring.conductor.drain();
    drain_deadline.emplace(context, milliseconds{wiring.limits.drain_ms} + kDrainMargin);
    drain_deadline->async_wait([this](const error_code& error) {
      if (error) return;
      if (wiring.conductor.drained()) return;
      log_warning("draining took too long: ending without waiting");
      gave_up = true;
      end_if_all_left();
    });
    arm_timer();
  }

  /// The shards write nothing any more, and whoever was told GOODBYE has left or had its time:
  /// closed before that, a connection on which it had sent something would be reset, and the
  /// GOODBYE lost.
  void end_if_all_left() {
    const bool all_told = wiring.conductor.drained() || gave_up;
    if (all_told && strangers.leaving() == 0 && leaving.empty()) context.stop();
  }

  const Wiring wiring;
  EventTurns turns;
  asio::io_context context{1};
  DescriptorReserve reserve;
  WaitingRoom strangers;
  std::vector<std::unique_ptr<net::Stream>> leaving;  ///< to be seen off by `strangers`
  DescriptorWatch strangers_watch;
  DescriptorWatch inbox_watch;
  DescriptorWatch dialler_watch;
  asio::steady_timer timer;
  std::optional<milliseconds> armed;  ///< when the timer fires, or is seen to have been late
  std::optional<asio::steady_timer> drain_deadline;
  asio::signal_set signals;
  asio::signal_set reloads;
  std::vector<std::unique_ptr<Door>> doors;
  bool stopping = false;
  bool gave_up = false;  ///< a shard did not drain in time
  bool telling = false;  ///< a piece of it is posted
};

ConductorLoop::ConductorLoop(const Wiring& wiring, std::vector<std::unique_ptr<Listener>> listeners)
    : impl_(std::make_unique<Impl>(wiring, std::move(listeners))) {}

ConductorLoop::~ConductorLoop() = default;

void ConductorLoop::run() {
  for (auto& door : impl_->doors) impl_->watch_door(*door);
  impl_->watch_strangers();
  impl_->watch_signals();
  impl_->watch_reloads();
  impl_->take_dialled();
  impl_->take_events();
  impl_->context.run();
}

}  // namespace gimnet::hub
