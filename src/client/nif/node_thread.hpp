#pragma once

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
#include "client/nif/dialer.hpp"
#include "client/nif/inbound.hpp"
#include "client/nif/keep_alive_timer.hpp"
#include "client/nif/node_parts.hpp"
#include "client/nif/token_store.hpp"

namespace gimnet::nif {

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
  void on_timers(std::int64_t now);
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
