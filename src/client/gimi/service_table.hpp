#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/inbox.hpp"
#include "client/gimi/published_service.hpp"
#include "client/gimi/send_stream.hpp"
#include "client/gimi/services.hpp"
#include "client/gimi/turns.hpp"
#include "client/gimi/uplink.hpp"

namespace gimnet::gimi {

/// The services that a node provides and subscribed, by name and by group id. Thread safety: any
/// thread. An advertised service stays in the table until the node is closed; a subscription goes
/// with its last handle.
class ServiceTable {
 public:
  /// `on_moved` is called without a lock of this table but the asking one, for each service that is
  /// somewhere else now: from the library's thread, or from a program's whose question the hub
  /// answered so.
  using OnMoved = std::function<void(const std::string& full_name, const ServicePlace& place)>;
  ServiceTable(Uplink& uplink, Inbox& inbox, OnMoved on_moved)
      : uplink_(uplink), inbox_(inbox), on_moved_(std::move(on_moved)) {}

  /// The calls of a program; they ask the hub, one after another. The time that one waits for the
  /// others counts.
  [[nodiscard]] Outcome<PublishedService*> advertise(const std::string& own_name,
                                                     const std::string& name,
                                                     const PublishOptions& options, Timeout timeout)
      GIMNET_EXCLUDES(asking_, mutex_);
  /// Lists a service that takes data; its group.
  [[nodiscard]] Outcome<std::uint32_t> accept(const std::string& own_name, const std::string& name,
                                              const AcceptOptions& options, Timeout timeout)
      GIMNET_EXCLUDES(asking_, mutex_);
  void withdraw(PublishedService& service) GIMNET_EXCLUDES(asking_, mutex_);
  /// Ends a service that accept() lists; `name` as there.
  void withdraw_accepted(const std::string& name) GIMNET_EXCLUDES(asking_);

  using Subscribed = std::shared_ptr<SubscribedService>;
  struct Reading {
    Subscribed service;
    SubscribedService::SharedSubscriber subscriber;
  };
  [[nodiscard]] Outcome<Reading> subscribe(const std::string& full_name,
                                           const SubscribeOptions& wish)
      GIMNET_EXCLUDES(asking_, mutex_);
  /// With the last subscriber of a service the subscription ends.
  void unsubscribe(const Reading& reading) GIMNET_EXCLUDES(asking_, mutex_);
  /// Services that are subscribed or sent to now.
  [[nodiscard]] std::size_t subscriptions() GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return subscribed_.size();
  }

  /// Begins a stream to a service: `make` is called once with where it is; what changes then comes
  /// to on_moved(), until unfollow().
  using Stream = std::shared_ptr<SendStream>;
  using MakeStream = std::function<Outcome<Stream>(const ServicePlace& place)>;
  [[nodiscard]] Outcome<Stream> follow(const std::string& full_name, Timeout timeout,
                                       const MakeStream& make) GIMNET_EXCLUDES(asking_, mutex_);
  /// The stream to that service ended; unless `again` says that there is one anew.
  void unfollow(const std::string& full_name, const std::function<bool()>& again)
      GIMNET_EXCLUDES(asking_, mutex_);
  /// The node has another name now: so have its services, in full.
  void on_renamed(const std::string& own_name) GIMNET_EXCLUDES(mutex_);

  /// From the library's thread. `not_yet`: the program is just asking the hub about a service, and
  /// this may belong behind the answer: nif_deliver() comes with it. `unwanted`: of a service that
  /// the program does not read (any more).
  enum class Place : std::uint8_t { found, unknown, not_yet, unwanted };
  struct Found {
    Place place = Place::unknown;
    Subscribed service;
  };
  [[nodiscard]] Found subscribed(std::uint32_t group) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Place on_subscribers(std::uint32_t group, std::size_t count)
      GIMNET_EXCLUDES(mutex_);
  /// The hub does not keep a message of that own service; `sent`: its header, if that is known.
  void on_not_retained(std::uint32_t group, const std::optional<proto::gimi::MessageHeader>& sent)
      GIMNET_EXCLUDES(mutex_);
  /// The refusal that a NIF_SERVICE_MOVED or NIF_OWN_SERVICE_MOVED tells; nothing: none.
  [[nodiscard]] static std::optional<Failure> refusal_of(const nif_incoming& moved) {
    if (moved.group != 0 || moved.reason == NIF_OK) return std::nullopt;
    const auto status = static_cast<nif_status>(moved.reason);
    std::string words(static_cast<const char*>(moved.payload), moved.size);
    if (words.empty()) words = nif_status_text(status);
    return Failure{status_of(status), std::move(words)};
  }
  [[nodiscard]] Place on_service_moved(const nif_incoming& moved) GIMNET_EXCLUDES(mutex_);
  /// `unknown`: nor is one of an earlier service of that name, which had `former`.
  struct OwnMove {
    std::uint32_t former = 0;
    std::uint32_t group = 0;
    std::optional<Failure> refusal{};  ///< the hub did not take it again
  };
  [[nodiscard]] Place on_own_service_moved(const std::string& name, const OwnMove& move)
      GIMNET_EXCLUDES(mutex_);
  void on_reconnected() GIMNET_EXCLUDES(mutex_);
  /// Tells the hub what subscriptions missed since it was told last.
  void tell_missed() GIMNET_EXCLUDES(mutex_);
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

 private:
  /// Of so many groups of subscriptions that ended it is known that messages on their way are not
  /// wanted.
  static constexpr std::size_t kEndedGroupsMax = 64;

  /// While one of these lives, groups that nobody knows are `not_yet`.
  class Asking;
  /// Why a service of that name cannot be declared; nothing if it can.
  [[nodiscard]] std::optional<Failure> obstacle(const std::string& own_name,
                                                const std::string& name) GIMNET_REQUIRES(asking_)
      GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Place unknown() const GIMNET_REQUIRES(mutex_) {
    return open_ != 0 ? Place::not_yet : Place::unknown;
  }
  [[nodiscard]] Subscribed entry(const std::string& full_name) GIMNET_EXCLUDES(mutex_);
  /// Asks the hub for what all subscribers want.
  [[nodiscard]] nif_status ask(const Subscribed& service, std::int32_t timeout_ms)
      GIMNET_REQUIRES(asking_) GIMNET_EXCLUDES(mutex_);
  void leave(const Reading& reading, std::int32_t timeout_ms) GIMNET_REQUIRES(asking_)
      GIMNET_EXCLUDES(mutex_);
  /// Takes it out of the table, unless somebody reads it or sends there.
  void forget_unused(const Subscribed& service) GIMNET_REQUIRES(asking_) GIMNET_EXCLUDES(mutex_);
  void set_place(const Subscribed& subscribed, const ServicePlace& place) GIMNET_REQUIRES(mutex_);
  void end_groups(SubscribedService& service) GIMNET_REQUIRES(mutex_);
  void forget_group(SubscribedService& service, std::uint32_t group) GIMNET_REQUIRES(mutex_);

  Uplink& uplink_;
  Inbox& inbox_;
  const OnMoved on_moved_;

  Turns asking_;  ///< taken while the hub is asked: its answers must be applied in the order of the
                  ///< questions
  std::set<std::string, std::less<>> own_names_
      GIMNET_GUARDED_BY(asking_);  ///< of services that are declared now

  Mutex mutex_;
  std::size_t open_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::string advertising_
      GIMNET_GUARDED_BY(mutex_);  ///< the service that the hub is asked for; "": none
  std::vector<std::unique_ptr<PublishedService>> published_ GIMNET_GUARDED_BY(mutex_);
  /// Those that were not withdrawn; also one that the hub did not take again, which has no group.
  std::map<std::string, PublishedService*, std::less<>> published_by_name_
      GIMNET_GUARDED_BY(mutex_);
  std::map<std::uint32_t, PublishedService*> published_by_group_ GIMNET_GUARDED_BY(mutex_);
  std::map<std::string, Subscribed, std::less<>> subscribed_ GIMNET_GUARDED_BY(mutex_);
  std::map<std::uint32_t, Subscribed> subscribed_by_group_ GIMNET_GUARDED_BY(mutex_);
  std::deque<std::uint32_t> ended_groups_ GIMNET_GUARDED_BY(mutex_);  ///< Limit: kEndedGroupsMax
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
