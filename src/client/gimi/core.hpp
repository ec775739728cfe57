#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/mutex.hpp"
#include "client/gimi/accepted_service.hpp"
#include "client/gimi/answer_queue.hpp"
#include "client/gimi/clerk.hpp"
#include "client/gimi/connection_events.hpp"
#include "client/gimi/inbox.hpp"
#include "client/gimi/loss_tally.hpp"
#include "client/gimi/open_requests.hpp"
#include "client/gimi/ping_table.hpp"
#include "client/gimi/reception.hpp"
#include "client/gimi/service_table.hpp"
#include "client/gimi/stream_table.hpp"
#include "client/gimi/uplink.hpp"
#include "client/gimi/watch_queues.hpp"

namespace gimnet::gimi {

/// A node: NIF's handle, and who takes what it delivers. Everything received comes on the library's
/// thread to on_incoming(), which sorts it and never waits. Thread safety: any thread.
class Core {
 public:
  static Outcome<std::shared_ptr<Core>> join(const NodeOptions& options);
  ~Core();
  Core(const Core&) = delete;
  Core& operator=(const Core&) = delete;

  void close() GIMNET_EXCLUDES(mutex_);
  /// The node was given this name by the hub, "" for none.
  void on_renamed() {
    const std::string name = state().name;
    services_.on_renamed(name);
    accepted_.on_renamed(name);
  }

  [[nodiscard]] const Home& home() const { return uplink_.home(); }
  [[nodiscard]] nif_node* node() const { return uplink_.node(); }
  /// After close(): as it was then.
  [[nodiscard]] NodeState state() const GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Inbox& inbox() { return inbox_; }
  [[nodiscard]] StreamTable& streams() { return streams_; }
  [[nodiscard]] ServiceTable& services() { return services_; }
  [[nodiscard]] WatchQueues& watches() { return watches_; }
  [[nodiscard]] OpenRequests& requests() { return requests_; }
  [[nodiscard]] AnswerTable& answers() { return answers_; }
  [[nodiscard]] AcceptedTable& accepted() { return accepted_; }
  [[nodiscard]] ConnectionEvents& connection() { return connection_; }
  /// Something is to be looked after at certain times.
  void attend() { clerk_.attend(true); }
  [[nodiscard]] LostCounts lost() const;
  [[nodiscard]] Outcome<TracedPing> ping(Peer to, Timeout timeout, Lane lane, BytesView echo,
                                         bool traced);

 private:
  explicit Core(const NodeOptions& options);
  static Outcome<std::shared_ptr<Core>> join_as(const NodeOptions& options);
  [[nodiscard]] nif_status connect(const NodeOptions& options);
  [[nodiscard]] NodeState state_now() const;

  static nif_verdict on_incoming(void* user, const nif_incoming* in);
  [[nodiscard]] nif_verdict dispatch(const nif_incoming& in);
  [[nodiscard]] nif_verdict on_own_service_moved(const nif_incoming& in);
  void on_gap(const nif_incoming& in);
  void on_connected(const nif_incoming& in);
  void on_disconnected(const nif_incoming& in);
  /// Tells what became of the connection.
  void tell(ConnectionChange change, std::string why);
  void end(const Ending& ending);

  Uplink uplink_;
  Inbox inbox_;
  StreamTable streams_;
  ServiceTable services_;
  WatchQueues watches_;
  OpenRequests requests_;
  AnswerTable answers_;
  AcceptedTable accepted_;
  ConnectionEvents connection_;
  PingTable pings_;
  LossTally losses_;
  mutable std::atomic<std::uint64_t> unreadable_{0};  ///< as NIF counted when it was asked last
  Clerk clerk_;
  Reception reception_;  ///< the library's thread
  std::atomic<bool> ready_{false};
  std::atomic<bool> closed_{false};
  mutable Mutex mutex_;
  std::optional<NodeState> closed_state_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
