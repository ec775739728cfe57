#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "base/mutex.hpp"
#include "base/random.hpp"
#include "client/nif/callback_delivery.hpp"
#include "client/nif/dial_plan.hpp"
#include "client/nif/error.hpp"
#include "client/nif/inbound.hpp"
#include "client/nif/node_parts.hpp"
#include "client/nif/session_terms.hpp"
#include "client/nif/token_store.hpp"

namespace gimnet::nif {

/// When a connection has to say something to stay alive, and when its hub was silent for too long.
/// Time is an argument. Thread safety: the library's thread.
class KeepAliveTimer {
 public:
  /// Keep-alive intervals after which the hub's clock is measured again, however busy the node is.
  static constexpr std::int64_t kMeasureIntervals = 5;

  /// A connection begins.
  void begin(const SessionTerms& session, std::int64_t now_ns) {
    interval_ns_ = session.keep_alive_ns;
    silent_after_ns_ = session.silent_after_ns;
    heard_ns_ = tick_ns_ = now_ns;
    ping_ns_ = 0;
  }
  /// Whether this node listens from now on. Nothing was heard while it did not: the hub gets its
  /// whole time again.
  void set_reading(bool reading, std::int64_t now_ns) {
    if (reading && !reading_) heard_ns_ = now_ns;
    reading_ = reading;
  }
  [[nodiscard]] bool is_reading() const { return reading_; }
  void heard(std::int64_t now_ns) { heard_ns_ = now_ns; }
  [[nodiscard]] bool silent_for_too_long(std::int64_t now_ns) const {
    return reading_ && now_ns - heard_ns_ >= silent_after_ns_;
  }

  /// When to look again, if nothing happens. `write_ns`: bytes went last then, whatever they were.
  [[nodiscard]] Deadline next(std::int64_t write_ns) const {
    Deadline next = std::min(tick_ns_, write_ns) + interval_ns_;
    next = std::max(next, tick_ns_ + interval_ns_ / 4);
    return reading_ ? std::min(next, heard_ns_ + silent_after_ns_) : next;
  }
  /// Nothing can be due within a quarter of the interval.
  [[nodiscard]] bool is_early(std::int64_t now_ns) const {
    return now_ns - tick_ns_ < interval_ns_ / 4;
  }
  /// A whole interval has passed: what came is confirmed now, whether a PING is due or not.
  [[nodiscard]] bool is_late(std::int64_t now_ns) const {
    return now_ns - tick_ns_ >= interval_ns_;
  }

  /// A PING is due: no byte went for a whole interval, or the clock is to be measured.
  [[nodiscard]] bool ping_due(std::int64_t write_ns, std::int64_t now_ns) const {
    return now_ns - write_ns >= interval_ns_ ||
           now_ns - ping_ns_ >= kMeasureIntervals * interval_ns_;
  }
  void ticked(std::int64_t now_ns) { tick_ns_ = now_ns; }
  void pinged(std::int64_t now_ns) { ping_ns_ = now_ns; }

 private:
  std::int64_t interval_ns_ = 0;
  std::int64_t silent_after_ns_ = 0;
  std::int64_t heard_ns_ = 0;
  std::int64_t tick_ns_ = 0;
  std::int64_t ping_ns_ = 0;  ///< 0: none on this connection
  bool reading_ = true;
};

/// The library's thread of a node: reads, keeps alive, writes what senders left to it, calls back,
/// dials again. It owns the connection. Thread safety: as each group of functions says.
class NodeThread {
 public:
  /// `host` is told what comes, on this thread.
  NodeThread(NodeParts& parts, InboundHost& host);

  // The connecting thread, and then the closing one.
  /// Dials, shakes hands and begins to run. Nothing: it runs.
  [[nodiscard]] std::optional<Failure> start();
  /// Writes what waits, says GOODBYE, and ends. REQUIRES: NodeParts::closing is set.
  void stop();
  /// In a child after fork(), where the thread is not: closes the descriptor. The rest has to be
  /// left alone, since any lock may be held by a thread that does not exist.
  void abandon() { stream_.reset(); }

  // Any thread.
  [[nodiscard]] bool is_current() const;
  /// The callback has room again.
  void deliver_again() {
    delivery_.again();
    parts_.wake.raise();
  }
  /// Work of the layer above on this thread at the end of each turn. Must not wait: Node::send()
  /// from this thread does not. Returns when it has to be called again at the latest.
  using Task = std::function<Deadline()>;
  /// The thread runs this from its next turn on; empty: none. When this returns, the former one is
  /// not running and will not. REQUIRES: not from a task.
  void set_task(Task task) GIMNET_EXCLUDES(task_mutex_);
  /// Something is due earlier than the task said.
  void rouse() { parts_.wake.raise(); }

  // This thread, for its host.
  /// Tells the hub what was taken, if it was not told before.
  void confirm();
  void tell_taken_again(NodeId to) { inbound_.tell_taken_again(to); }
  /// Takes up what NodeStatus::set_name() left.
  void take_new_name();

 private:
  void run();
  void turn();
  void read_some(std::int64_t now);
  void take_read(std::size_t bytes, std::int64_t now);
  /// In each turn, however much there is to read: keeps alive, confirms, notices silence.
  /// `written_ns`: bytes went then, or later.
  void on_timers(std::int64_t now, std::int64_t written_ns);
  void run_task() GIMNET_EXCLUDES(task_mutex_);
  void redial();
  void disconnect(std::string why, proto::GoodbyeCode code);
  void on_goodbye(const proto::Goodbye& goodbye);
  void end_of_dialing(Failure failure);
  /// Connected, but not as this node may: leaves again.
  void turn_down(Admitted admitted);
  void end(const Failure& failure, std::string why, proto::GoodbyeCode code);
  void leave();

  [[nodiscard]] proto::Hello hello() const;
  void keep_token() {
    tokens_.keep(address_, session_.token);
    parts_.record.took_token(tokens_);
  }
  /// Neither end can go on with the counts of the session.
  void begin_epoch() {
    epoch_ = random_bits() | 1;
    session_.hub_epoch = 0;
  }
  /// False: the hub's counts are impossible.
  [[nodiscard]] bool take_over(Admitted admitted, bool first);
  void tell_connected(std::uint64_t let_go, bool first, bool same_id);

  NodeParts& parts_;
  std::thread thread_;
  std::atomic<bool> has_task_{false};

  Mutex task_mutex_;  ///< held while it runs
  Task task_ GIMNET_GUARDED_BY(task_mutex_);

  // This thread (before it starts: the connecting one).
  Inbound inbound_;
  TokenStore tokens_;
  DialPlan plan_;
  KeepAliveTimer keep_alive_;
  CallbackDelivery delivery_;
  std::unique_ptr<net::Stream> stream_;  ///< null: not connected
  SessionTerms session_;
  std::string address_;  ///< of the hub that admitted it last, as a URL
  std::string name_;     ///< to ask for
  std::uint64_t epoch_ = 0;
  std::uint64_t confirmed_ = 0;
  bool ended_ = false;
  Deadline task_at_ = kNever;  ///< the task runs then at the latest
};

}  // namespace gimnet::nif
