#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/inbox.hpp"
#include "client/gimi/message.hpp"
#include "client/gimi/service_table.hpp"
#include "client/gimi/uplink.hpp"

namespace gimnet::gimi {

/// An own service that takes data, with the queue of its messages. Thread safety: any thread.
/// Lifetime: the inbox outlives it.
class AcceptedService {
 public:
  AcceptedService(Inbox& inbox, std::string name, const std::string& own_name,
                  const QueueOptions& options)
      : queue(inbox.add_queue({options})), name_(std::move(name)) {
    on_renamed(own_name);
  }
  ~AcceptedService() { queue.inbox().remove(queue); }
  AcceptedService(const AcceptedService&) = delete;
  AcceptedService& operator=(const AcceptedService&) = delete;

  /// Without the node's.
  [[nodiscard]] const std::string& name() const { return name_; }
  /// The present full name; without the node's name while the node has none.
  [[nodiscard]] OwnedServiceName full_name() GIMNET_EXCLUDES(mutex_);
  /// Does the hub have it? Errors: why it did not take it again; closed.
  [[nodiscard]] Outcome<void> standing() GIMNET_EXCLUDES(mutex_);

  /// The node has another name now.
  void on_renamed(const std::string& own_name) GIMNET_EXCLUDES(mutex_);
  /// The hub has it (again).
  void on_taken() GIMNET_EXCLUDES(mutex_);
  /// The hub did not take it again.
  void on_refused(Failure refusal) GIMNET_EXCLUDES(mutex_);
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

  MessageQueue& queue;
  /// The id under which the hub has it; 0: none. Guarded by the table's mutex, as the next one.
  std::uint32_t group = 0;
  bool asked = true;  ///< the hub has not answered yet whether it takes it

 private:
  const std::string name_;
  Mutex mutex_;
  OwnedServiceName full_name_ GIMNET_GUARDED_BY(mutex_);
  std::optional<Failure> refusal_ GIMNET_GUARDED_BY(mutex_);
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

/// The own services that take data, by group id. Thread safety: any thread. Limits: those of the
/// hub, and kEndedGroupsMax.
class AcceptedTable {
 public:
  using Place = ServiceTable::Place;
  using Service = std::shared_ptr<AcceptedService>;
  AcceptedTable(Uplink& uplink, Inbox& inbox) : uplink_(uplink), inbox_(inbox) {}

  /// Makes a service, before the hub is asked for it.
  [[nodiscard]] Service add(const std::string& own_name, const std::string& name,
                            const QueueOptions& options) GIMNET_EXCLUDES(mutex_);
  /// The hub took it.
  void place(const Service& service, std::uint32_t group) GIMNET_EXCLUDES(mutex_);
  /// Nothing comes into its queue any more.
  void remove(const Service& service) GIMNET_EXCLUDES(mutex_);

  /// The service of a group. `not_yet`: the hub was asked for one and its answer may name that
  /// group; nif_deliver() comes with it. `unwanted`: of a service that was removed.
  struct Found {
    Place place = Place::unknown;
    Service service;
  };
  [[nodiscard]] Found find(std::uint32_t group) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Place on_own_service_moved(const std::string& name,
                                           const ServiceTable::OwnMove& move)
      GIMNET_EXCLUDES(mutex_);
  void on_renamed(const std::string& own_name) GIMNET_EXCLUDES(mutex_);
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

 private:
  /// Of so many groups of services that were removed it is known that messages on their way are not
  /// wanted.
  static constexpr std::size_t kEndedGroupsMax = 64;

  void forget_group(const Service& service) GIMNET_REQUIRES(mutex_);

  Uplink& uplink_;
  Inbox& inbox_;
  Mutex mutex_;
  std::vector<Service> services_ GIMNET_GUARDED_BY(mutex_);
  std::map<std::uint32_t, Service> by_group_ GIMNET_GUARDED_BY(mutex_);
  std::deque<std::uint32_t> ended_groups_ GIMNET_GUARDED_BY(mutex_);  ///< Limit: kEndedGroupsMax
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
