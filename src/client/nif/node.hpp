#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "base/mutex.hpp"
#include "client/nif/credit_book.hpp"
#include "client/nif/declarations.hpp"
#include "client/nif/dialer.hpp"
#include "client/nif/hub_clock.hpp"
#include "client/nif/inbound.hpp"
#include "client/nif/name_cache.hpp"
#include "client/nif/options.hpp"
#include "client/nif/outbound.hpp"
#include "client/nif/receive_queue.hpp"
#include "client/nif/request_table.hpp"
#include "client/nif/token_store.hpp"
#include "client/nif/watch_table.hpp"

namespace gimnet::nif {

/// One node: a connection to a hub, made again when it breaks, with its library thread.
/// Thread safety: public functions from any thread. Ownership: of the stream and the thread.
class Node final : private InboundHost {
 public:
  /// Dials, shakes hands, starts the thread. Errors: as nif_connect().
  [[nodiscard]] static Result<std::unique_ptr<Node>, Failure> connect(Options options);
  /// REQUIRES: close() was called, and no other thread is inside.
  ~Node();

  /// A node has one owner at first, and is destroyed when the last one drops it.
  void add_owner() { owners_.fetch_add(1); }
  void drop() {
    if (owners_.fetch_sub(1) == 1) delete this;
  }

  [[nodiscard]] Outbound& outbound() { return outbound_; }
  [[nodiscard]] ReceiveQueue& received() { return received_; }
  [[nodiscard]] RequestTable& requests() { return requests_; }
  [[nodiscard]] Declarations& declarations() { return declarations_; }
  [[nodiscard]] WatchTable& watches() { return watches_; }
  [[nodiscard]] NameCache& names() { return names_; }
  [[nodiscard]] CreditBook& credits() { return credits_; }
  [[nodiscard]] HubClock& clock() { return clock_; }
  /// The hub registered this node under another name, "" for none. The library's thread declares
  /// the services anew.
  void set_name(const std::string& name, std::vector<std::byte> token) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] const Options& options() const { return options_; }

  [[nodiscard]] std::uint32_t id() const {
    return id_.load(std::memory_order_relaxed);  // a number by itself
  }
  [[nodiscard]] nif_info info() GIMNET_EXCLUDES(mutex_);
  /// Connections after the first. Grows before anything is declared on the new connection.
  [[nodiscard]] std::uint32_t reconnects() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] nif_counters counters() GIMNET_EXCLUDES(mutex_);
  /// As nif_send().
  [[nodiscard]] nif_status send(const nif_outgoing& message, std::int32_t timeout_ms);
  [[nodiscard]] std::string last_error() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] nif_status ping_hub(HubClock::Measurement& measured, Deadline deadline);
  /// The callback has room again.
  void deliver_again();
  /// The calling thread is this node's library thread.
  [[nodiscard]] bool in_callback() const;
  /// Work of the layer above on the library's thread at the end of each turn. Must not wait:
  /// send() from that thread does not. Returns when it has to be called again at the latest.
  using Task = std::function<Deadline()>;
  /// The library's thread runs this from its next turn on; empty: none. When this returns, the
  /// former one is not running and will not. REQUIRES: not from a task.
  void set_task(Task task) GIMNET_EXCLUDES(task_mutex_);
  /// Something is due earlier than the task said.
  void rouse() { wake_.raise(); }

  /// Makes every waiting call leave with NIF_CLOSED, now and from now on.
  void begin_close();
  /// Writes what waits, says GOODBYE, ends the thread. REQUIRES: begin_close() was called.
  void close();
  /// In a child after fork(), where the thread is not: closes the descriptor. The rest has to be
  /// left alone, since any lock may be held by a thread that does not exist.
  void abandon();

 private:
  explicit Node(Options options);

  // InboundHost, on the library's thread.
  [[nodiscard]] bool on_flow(const proto::flow::Message& message) override;
  [[nodiscard]] std::vector<Item> on_answer(proto::Kind kind,
                                            const proto::ControlView& answer) override;
  bool on_service_moved(const proto::ns::ServiceMoved& event) override;
  [[nodiscard]] bool on_watch_events(const proto::ns::WatchEvents& events) override;
  void on_taken(std::uint32_t from, const proto::Taken& taken) override;
  bool on_report(const proto::Report& report) override;
  [[nodiscard]] std::optional<ReportedMessages::Start> message_of(
      const proto::Report& report) override;
  void send_taken(std::uint32_t to, const proto::Taken& taken) override;
  [[nodiscard]] std::uint32_t epoch_for(std::uint32_t group) override {
    return credits_.epoch_for(group);
  }
  [[nodiscard]] bool may_wait(std::uint32_t group, std::size_t bytes) override {
    return declarations_.may_wait(GroupId{group}, bytes);
  }
  void on_message_lost(std::uint32_t group) override {
    credits_.take(group, epoch_for(group), 1, false);
  }
  void deliver(std::span<const Item> items) override;

  // The library's thread, node_thread.cpp.
  void run();
  void turn();
  void read_some(std::int64_t now);
  void take_read(std::size_t bytes, std::int64_t now);
  void on_timers(std::int64_t now, bool reading);
  [[nodiscard]] Deadline next_timer(bool reading, std::int64_t last_write_ns) const;
  void call_back();
  void run_task() GIMNET_EXCLUDES(task_mutex_);
  [[nodiscard]] std::size_t call_back_with(std::span<const Item> items);
  void confirm();
  void redial();
  void disconnect(std::string why, proto::GoodbyeCode code);
  void on_goodbye(const proto::Goodbye& goodbye);
  [[nodiscard]] std::optional<Failure> ending_of(const std::string& why,
                                                 proto::GoodbyeCode code) const;
  /// The hub keeps the session, and this node may dial to take it up again.
  [[nodiscard]] bool may_resume(proto::GoodbyeCode code) const;
  /// A dial failed. True: another may help.
  [[nodiscard]] bool dials_again(const Failure& failure) const;
  void end_of_dialing(Failure failure);
  /// Connected, but not as this node may: leaves again.
  void turn_down(Admitted admitted);
  void set_disconnected(const std::string& why, bool for_good) GIMNET_EXCLUDES(mutex_);
  void end(const Failure& failure, std::string why, proto::GoodbyeCode code)
      GIMNET_EXCLUDES(mutex_);
  void leave();

  [[nodiscard]] proto::Hello hello() const;
  /// The hubs to dial now, in this order.
  [[nodiscard]] std::span<const net::Address> hubs_to_dial() const;
  void take_new_name() GIMNET_EXCLUDES(mutex_);
  void keep_token() GIMNET_EXCLUDES(mutex_);
  /// False: the hub's counts are impossible.
  [[nodiscard]] bool take_over(Admitted admitted, bool first);
  void set_last_error(std::string sentence) GIMNET_EXCLUDES(mutex_);
  void push_event(Record* record);

  const Options options_;
  net::WakeSignal wake_;
  net::WakeSignal stop_;
  Outbound outbound_;
  ReceiveQueue received_;
  RequestTable requests_;
  CreditBook credits_;
  Declarations declarations_;
  WatchTable watches_;
  NameCache names_;
  HubClock clock_;
  std::thread thread_;

  std::atomic<std::uint32_t> id_{0};
  std::atomic<bool> closing_{false};
  std::atomic<std::uint32_t> deliver_calls_{0};
  std::atomic<std::uint32_t> owners_{1};
  std::atomic<bool> has_task_{false};

  Mutex task_mutex_;  ///< held while it runs
  Task task_ GIMNET_GUARDED_BY(task_mutex_);

  Mutex mutex_;
  nif_info info_ GIMNET_GUARDED_BY(mutex_){};
  std::string last_error_ GIMNET_GUARDED_BY(mutex_);
  struct NewName {
    std::string name;
    std::vector<std::byte> token;
  };
  std::optional<NewName> new_name_
      GIMNET_GUARDED_BY(mutex_);  ///< given while connected, not seen to yet
  Inbound::Counts inbound_counts_ GIMNET_GUARDED_BY(mutex_);
  std::uint64_t bytes_received_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::uint64_t read_calls_ GIMNET_GUARDED_BY(mutex_) = 0;

  // The library's thread (before it starts: the connecting one).
  Inbound inbound_;
  TokenStore tokens_;
  std::unique_ptr<net::Stream> stream_;  ///< null: not connected
  SessionTerms session_;
  std::string address_;                  ///< of the hub that admitted it last, as a URL
  std::string name_;                     ///< to ask for
  std::vector<net::Address> addresses_;  ///< of hubs; the one that admitted it last comes first
  bool hub_ends_ = false;                ///< that hub said so
  net::DialBackoff backoff_;
  std::uint64_t epoch_ = 0;
  std::uint64_t confirmed_ = 0;
  std::int64_t last_heard_ns_ = 0;
  std::int64_t last_tick_ns_ = 0;
  std::int64_t last_ping_ns_ = 0;  ///< 0: none on this connection
  bool was_reading_ = true;
  bool resumes_only_ = false;  ///< the next connection has to resume the session ...
  std::int64_t broke_ns_ = 0;  ///< ... whose last one broke then
  bool ended_ = false;
  Deadline task_at_ = kNever;  ///< the task runs then at the latest
  std::array<Item, 64>
      in_hand_;                ///< taken out of the receive queue under one lock, for the callback
  bool held_ = false;          ///< the callback said NIF_NOT_NOW ...
  std::uint32_t held_at_ = 0;  ///< ... after so many deliver_again()
};

}  // namespace gimnet::nif
