#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/inbox.hpp"
#include "client/gimi/message.hpp"
#include "client/gimi/message_queue.hpp"
#include "client/gimi/missed_numbers.hpp"
#include "client/gimi/received_streams.hpp"
#include "client/gimi/send_stream.hpp"
#include "gimnet/gimi/options.hpp"
#include "gimnet/gimi/outcome.hpp"

namespace gimnet::gimi {

/// The higher one of two bounds, of which 0 is none.
template <class T>
[[nodiscard]] T higher_bound(T one, T other) {
  return one == T{} || other == T{} ? T{} : std::max(one, other);
}

/// The terms on which the hub is asked for a service.
struct Share {
  std::uint32_t window = 0;  ///< 0: as the service has it
  std::uint32_t depth = 1;
  double rate_hz = 0.0;  ///< 0: no bound
  friend bool operator==(const Share&, const Share&) = default;
};

/// One subscribe() of a program: what it wants, and the queue of its messages. Lifetime: the inbox
/// outlives it.
struct Subscriber {
  Subscriber(Inbox& inbox, const SubscribeOptions& options, bool latest)
      : wish(options), queue(inbox.add_queue(queue_terms(latest), options.silence)) {}
  ~Subscriber() { queue.inbox().remove(queue); }
  Subscriber(const Subscriber&) = delete;
  Subscriber& operator=(const Subscriber&) = delete;

  [[nodiscard]] Share share() const;
  /// `latest`: of a service with that delivery.
  [[nodiscard]] QueueTerms queue_terms(bool latest) const;

  const SubscribeOptions wish;
  MessageQueue& queue;
  MissedNumbers numbers;  ///< guarded by the service's mutex, as the next one
  bool begun = false;     ///< a message came for it
};

/// A service of another node that this one subscribed, to read it or to know where it is. Thread
/// safety: any thread.
class SubscribedService {
 public:
  SubscribedService(std::string full_name, Inbox& inbox)
      : name_(new ServiceName(std::move(full_name))), inbox_(inbox) {}

  [[nodiscard]] ServiceName& shared_name() const { return *name_; }
  [[nodiscard]] const std::string& name() const { return name_->text; }

  // ---- who reads it

  using SharedSubscriber = std::shared_ptr<Subscriber>;
  /// Messages come into its queue from now on.
  [[nodiscard]] SharedSubscriber add(const SubscribeOptions& wish) GIMNET_EXCLUDES(mutex_);
  /// Nothing comes into its queue any more.
  void remove(const Subscriber& subscriber) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] bool is_read() GIMNET_EXCLUDES(mutex_);
  /// As much as the subscriber wants that wants most.
  [[nodiscard]] Share share() GIMNET_EXCLUDES(mutex_);
  /// The hub was asked for that rate and agreed: it sends no more from now on.
  void on_granted(double rate_hz) GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    hub_rate_hz_ = rate_hz;
    pace_queues();
  }
  /// Messages that did not come for it, by their sequence. One that comes late is taken off again.
  [[nodiscard]] std::uint64_t missed(const Subscriber& subscriber) GIMNET_EXCLUDES(mutex_);

  /// All that its subscribers missed, as its hub is told: without those that did not come to a
  /// subscriber that wants no more than a rate.
  [[nodiscard]] std::uint64_t missed_in_all() GIMNET_EXCLUDES(mutex_);
  /// Words for people if those that want every message missed more than at the last call; else "".
  [[nodiscard]] std::string news_of_missed() GIMNET_EXCLUDES(mutex_);

  // ---- where it is

  /// There is a provider.
  [[nodiscard]] bool exists() GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return exists_;
  }
  /// There is one who takes data under that name: nothing will come.
  [[nodiscard]] bool accepts() GIMNET_EXCLUDES(mutex_) {
    const MutexLock lock(mutex_);
    return accepts_;
  }
  /// Null, or words for people: it takes data or questions instead.
  [[nodiscard]] const char* gives_none() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> wait_until_exists(Timeout timeout) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> standing() GIMNET_EXCLUDES(mutex_);
  /// The hub did not take the subscription again, and was not asked since.
  [[nodiscard]] bool is_refused() GIMNET_EXCLUDES(mutex_);

  /// One of its messages, as far as it says where it stands.
  struct Position {
    Peer from;
    MessageKey key;
    std::uint32_t epoch = 0;
    std::uint32_t sequence = 0;
    friend bool operator==(const Position&, const Position&) = default;
  };
  /// Tells what a message would be. Changes nothing.
  [[nodiscard]] StreamEpochs::Step look(const Position& message) GIMNET_EXCLUDES(mutex_);
  /// Puts one of its messages into the queues of all subscribers. The message that came last may
  /// come once more, with what is retained: it goes to subscribers of which nothing came yet.
  /// `unwanted`: nobody takes it; `no_room`: a queue refuses it, and it is in none. Without a
  /// position: it has no GIMI header. REQUIRES: look() is not `former`.
  enum class Put : std::uint8_t { kept, unwanted, no_room };
  [[nodiscard]] Put put(const std::optional<Position>& position, Message& message)
      GIMNET_EXCLUDES(mutex_);
  /// One of its messages is too large for this node: it counts as missed.
  void miss(const Position& position) GIMNET_EXCLUDES(mutex_);
  void on_place(const ServicePlace& now) GIMNET_EXCLUDES(mutex_);
  /// The hub did not take the subscription again; until on_place().
  void on_refused(Failure refusal) GIMNET_EXCLUDES(mutex_);
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

  /// The hub keeps its last message, as it answered last; guarded by the table's asking mutex.
  bool retained = false;
  /// A stream of this node leads there; guarded by the table's asking mutex.
  bool followed = false;
  /// The hub knows of so many missed messages; guarded by the table's mutex.
  std::uint64_t missed_told = 0;
  /// Its place now; guarded by the table's mutex.
  ServicePlace place;
  /// Group ids that lead to it, the youngest last; guarded by the table's mutex.
  std::vector<std::uint32_t> groups;

 private:
  /// Providers of which the epochs are remembered: the name goes from one to another seldom.
  static constexpr std::size_t kProvidersMax = 8;
  struct Stream {
    Peer from;
    MessageKey key;
    StreamEpochs epochs;
  };
  [[nodiscard]] Stream* find(const Position& message) GIMNET_REQUIRES(mutex_);
  [[nodiscard]] const char* reason() const GIMNET_REQUIRES(mutex_);
  [[nodiscard]] Share widest_share() const GIMNET_REQUIRES(mutex_);
  /// The queues of those that want a lower rate than the hub may send keep it themselves.
  void pace_queues() GIMNET_REQUIRES(mutex_);
  /// The part of missed_in_all() that one subscriber missed.
  [[nodiscard]] std::uint64_t missed_by(const Subscriber& subscriber) GIMNET_REQUIRES(mutex_);
  /// One of its messages is about to be put into queues: whoever takes it knows what is missing
  /// before it.
  void count_missed(const Position& message) GIMNET_REQUIRES(mutex_);
  /// It is of the stream of which messages came last.
  [[nodiscard]] bool goes_on(const Position& message) const GIMNET_REQUIRES(mutex_) {
    return message.from == last_.from && message.epoch == last_.epoch;
  }
  /// One of its messages is in a queue, or will not be.
  void take(const Position& message) GIMNET_REQUIRES(mutex_);

  const OwnedServiceName name_;
  Inbox& inbox_;

  Mutex mutex_;
  Condition changed_;
  std::vector<SharedSubscriber> subscribers_ GIMNET_GUARDED_BY(mutex_);
  /// The hub may send at this rate: the highest that it was asked for since it last agreed to one.
  /// 0: no bound. Nothing: it was not asked yet.
  std::optional<double> hub_rate_hz_ GIMNET_GUARDED_BY(mutex_);
  bool latest_ GIMNET_GUARDED_BY(mutex_) = false;  ///< its delivery
  bool exists_ GIMNET_GUARDED_BY(mutex_) = false;
  bool accepts_ GIMNET_GUARDED_BY(mutex_) = false;
  bool answers_ GIMNET_GUARDED_BY(mutex_) = false;
  std::optional<Failure> refusal_ GIMNET_GUARDED_BY(mutex_);
  /// The one with the highest number of the stream that came last; from nobody: nothing came yet.
  Position last_ GIMNET_GUARDED_BY(mutex_);
  Position counted_ GIMNET_GUARDED_BY(mutex_);             ///< by count_missed(), last
  std::vector<Stream> streams_ GIMNET_GUARDED_BY(mutex_);  ///< the one that began last is the last
  std::uint64_t missed_news_ GIMNET_GUARDED_BY(mutex_) = 0;  ///< that news_of_missed() told
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
