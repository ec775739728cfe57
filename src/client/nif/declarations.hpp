#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "base/mutex.hpp"
#include "client/nif/credit_book.hpp"
#include "client/nif/outbound.hpp"
#include "client/nif/request_table.hpp"
#include "client/nif/storage.hpp"
#include "proto/control/ns.hpp"

namespace gimnet::nif {

/// The own services and subscriptions, so that they can be declared again after a reconnect.
/// Thread safety: add, remove and find from any thread; the rest from the library's.
class Declarations {
 public:
  Declarations(RequestTable& requests, Outbound& outbound, CreditBook& credits)
      : requests_(requests), outbound_(outbound), credits_(credits) {}

  void add_service(const proto::ns::Advertise& service, GroupId group) GIMNET_EXCLUDES(mutex_);
  void remove_service(GroupId group) GIMNET_EXCLUDES(mutex_);
  /// The program is about to advertise a service of that name: one that ended is not withdrawn any
  /// more. True: there is such a one, which ends again where the hub does not take the new one.
  [[nodiscard]] bool begin_service(const std::string& service) GIMNET_EXCLUDES(mutex_);
  /// The service of that name ends: it is declared no more, and withdrawn wherever the hub may have
  /// it. Returns the group to withdraw now, 0: none, the rest is the library's thread's; nothing:
  /// there is no such service.
  [[nodiscard]] std::optional<GroupId> end_service(const std::string& service)
      GIMNET_EXCLUDES(mutex_);
  /// The hub does not have the group (any more) that end_service() named.
  void finish_service(const std::string& service, GroupId group) GIMNET_EXCLUDES(mutex_);
  void add_subscription(const proto::ns::Subscribe& subscription,
                        const proto::ns::ServiceState& state) GIMNET_EXCLUDES(mutex_);
  /// The former state of a subscription that the program begins or changes.
  struct Former {
    proto::ns::Subscribe request;
    bool ended = false;
  };
  /// The program is about to subscribe to a service. One that is subscribed already is declared by
  /// the new terms from now on, and one that ended is not ended any more. Nothing: there was none.
  /// Gives the request its count number.
  [[nodiscard]] std::optional<Former> begin_subscription(proto::ns::Subscribe& request)
      GIMNET_EXCLUDES(mutex_);
  /// The request gets another count number.
  void count_anew(proto::ns::Subscribe& request) GIMNET_EXCLUDES(mutex_);
  /// The hub did not take what was begun. `heard`: it said so, and what there was goes on; else it
  /// may have taken it, and is asked with the next connection, unless the subscription had ended.
  void give_up_subscription(const std::string& full_name, const std::optional<Former>& former,
                            bool heard) GIMNET_EXCLUDES(mutex_);
  /// The subscription ends: it is declared no more, and the hub is told with the next connection if
  /// finish_subscription() does not come before. False: there is none, or it ended already.
  bool end_subscription(const std::string& full_name) GIMNET_EXCLUDES(mutex_);
  /// The hub does not have it (any more).
  void finish_subscription(const std::string& full_name) GIMNET_EXCLUDES(mutex_);

  /// Lives while the program waits for the answer to its SUBSCRIBE.
  class Subscribing {
   public:
    explicit Subscribing(Declarations& declarations) : declarations_(declarations) {
      declarations_.subscribing_.fetch_add(1);
    }
    ~Subscribing() {
      const MutexLock lock(declarations_.mutex_);
      if (declarations_.subscribing_.fetch_sub(1) == 1) declarations_.answered_.clear();
    }
    Subscribing(const Subscribing&) = delete;
    Subscribing& operator=(const Subscribing&) = delete;

   private:
    Declarations& declarations_;
  };
  /// The hub answered a SUBSCRIBE: messages of that group follow, before the program knows.
  void on_subscribe_answer(GroupId group) GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    if (subscribing_.load() != 0) answered_.insert(group.value());
  }
  /// Of groups that the program has not subscribed so many bytes may wait in the receive queue
  /// while a SUBSCRIBE is unanswered. Then a full queue cannot keep the answer from being read.
  static constexpr std::size_t kUnknownBytesMax = 64 * 1024;
  /// A message of that group and size came. False: it is beyond kUnknownBytesMax; a NIF_GAP tells
  /// the number of these messages once no SUBSCRIBE is unanswered.
  [[nodiscard]] bool may_wait(GroupId group, std::size_t bytes) GIMNET_EXCLUDES(mutex_);

  /// Why everything is declared again.
  struct Occasion {
    bool anew = false;       ///< a WELCOME that was not `resumed`: counts begin anew
    bool forgotten = false;  ///< what the hub kept of retained services may be gone
  };
  /// Declares everything again, a few requests at a time. GROUP messages wait until that is
  /// through; before newer ones a hub that forgot the last messages of retained services gets them
  /// again.
  void declare_again(const Occasion& occasion) GIMNET_EXCLUDES(mutex_);
  /// Goes on declaring where numbers for requests were short.
  void go_on() GIMNET_EXCLUDES(mutex_);
  /// False: nothing that the program waits for.
  [[nodiscard]] bool on_service_moved(const proto::ns::ServiceMoved& event) GIMNET_EXCLUDES(mutex_);
  /// Has the hub said last that the service is away? False also of one that is not subscribed.
  [[nodiscard]] bool is_away(const std::string& full_name) GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    const auto found = subscriptions_.find(full_name);
    return found != subscriptions_.end() && found->second.away;
  }
  /// The events of the last answer for the program. Takes the references along.
  [[nodiscard]] std::vector<Item> take_events();
  ~Declarations();

 private:
  /// Requests under way at a time, so that the program's own find free numbers.
  static constexpr std::size_t kAtOnce = 32;

  struct Service {
    proto::ns::Advertise request;
    GroupId group;
    GroupId last_group;  ///< while the hub refuses it: the one that it had before, unless another
                         ///< one has that
    bool last_due = false;  ///< retained, and the hub may not have the last message
    bool asked =
        false;  ///< an ADVERTISE of the library has no answer yet, on this connection or for ever
    bool ended = false;  ///< for the program, and the hub may still have it
  };
  struct Subscription {
    /// Returns whether the provider, its session, or whether it is away, is new.
    bool take_provider(const proto::ns::ServiceState& now) {
      const bool same = provider == now.provider && session == now.session && away == now.away;
      provider = now.provider;
      session = now.session;
      away = now.away;
      return !same;
    }
    proto::ns::Subscribe request;
    GroupId group;
    GroupId former;  ///< when it was declared last
    NodeId provider;
    std::uint64_t session = 0;  ///< of the provider
    bool away = false;          ///< it accepts, and has lost its connection
    bool ended = false;         ///< for the program, and the hub may still have it
    bool refused = false;       ///< by the hub, when it was declared last
  };
  void on_advertised(const std::string& service, const proto::Payload& payload)
      GIMNET_EXCLUDES(mutex_);
  void on_subscribed(const std::string& full_name, const proto::Payload& payload)
      GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] bool declare_service(const std::string& service) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] bool withdraw_service(const std::string& service, GroupId group)
      GIMNET_REQUIRES(mutex_);
  [[nodiscard]] bool declare_subscription(const std::string& full_name) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] bool unsubscribe(const std::string& full_name) GIMNET_REQUIRES(mutex_);
  void enter_group(Service& service, GroupId group) GIMNET_REQUIRES(mutex_);
  void end_declaring();
  void add_gap(std::uint64_t count, proto::DropReason reason);
  [[nodiscard]] SendQueue::GroupMap moves() GIMNET_EXCLUDES(mutex_);
  void bring_last_messages() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] bool is_subscribed(GroupId group) const GIMNET_REQUIRES(mutex_);
  /// One of this round's requests. False: it has to wait for a free number.
  [[nodiscard]] bool ask(const proto::Payload& request, RequestTable::Handler on_answer);

  RequestTable& requests_;
  Outbound& outbound_;
  CreditBook& credits_;

  Mutex mutex_;
  std::map<std::string, Service> services_
      GIMNET_GUARDED_BY(mutex_);  ///< by their name within this node
  std::map<std::string, Subscription> subscriptions_ GIMNET_GUARDED_BY(mutex_);
  /// Count numbers of subscriptions that the program begins. Limit: its threads.
  std::map<std::string, std::uint8_t> beginning_ GIMNET_GUARDED_BY(mutex_);
  std::uint8_t next_number_ GIMNET_GUARDED_BY(mutex_) = 0;
  /// Groups of which the hub told while a SUBSCRIBE of the program is unanswered. Limit: requests
  /// that are answered or given up meanwhile.
  std::set<std::uint32_t> answered_ GIMNET_GUARDED_BY(mutex_);
  std::atomic<std::size_t> subscribing_{0};  ///< SUBSCRIBEs for which the program waits

  // The library's thread.
  std::deque<std::string> services_due_;       ///< Limit: services_
  std::deque<std::string> subscriptions_due_;  ///< Limit: subscriptions_
  std::size_t under_way_ = 0;
  bool declaring_ = false;
  std::uint64_t round_ = 0;  ///< answers of an earlier connection do not count
  std::vector<Item> events_;
  std::size_t unknown_bytes_ = 0;   ///< see may_wait()
  std::uint64_t unknown_lost_ = 0;  ///< messages that it dropped and no event told yet
};

}  // namespace gimnet::nif
