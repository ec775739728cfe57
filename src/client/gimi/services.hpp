#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/inbox.hpp"
#include "client/gimi/message.hpp"
#include "client/gimi/message_queue.hpp"
#include "client/gimi/received_streams.hpp"
#include "client/gimi/send_stream.hpp"
#include "client/gimi/uplink.hpp"
#include "gimnet/gimi/handles.hpp"
#include "gimnet/gimi/options.hpp"
#include "gimnet/gimi/outcome.hpp"

namespace gimnet::gimi {

/// An own service that provides data. Thread safety: any thread; nothing that is called from the
/// library's thread waits for a thread that publishes.
class PublishedService {
 public:
  PublishedService(Uplink& uplink, std::string name, std::string full_name,
                   const PublishOptions& options)
      : uplink_(uplink),
        name_(std::move(name)),
        options_(options),
        full_name_(std::move(full_name)) {}

  [[nodiscard]] const std::string& name() const { return name_; }
  /// As it is now; without the node's name while the node has none.
  [[nodiscard]] std::string full_name() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> publish(BytesView data, Timeout timeout, More more)
      GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::size_t subscribers() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> wait_for_subscribers(std::size_t count, Timeout timeout)
      GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::uint64_t published() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> standing() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> retained() GIMNET_EXCLUDES(mutex_);

  /// 0: the hub refuses it at the moment.
  [[nodiscard]] std::uint32_t group() GIMNET_EXCLUDES(mutex_);
  void on_group(std::uint32_t group) GIMNET_EXCLUDES(mutex_);
  /// Why that is so: the hub's words.
  void on_refused(Failure refusal) GIMNET_EXCLUDES(mutex_);
  void on_subscribers(std::size_t count) GIMNET_EXCLUDES(mutex_);
  /// The hub does not keep a message; `sent`: its header, if that is known.
  void on_not_retained(const std::optional<proto::gimi::MessageHeader>& sent)
      GIMNET_EXCLUDES(mutex_);
  /// The node has another name now.
  void on_renamed(const std::string& own_name) GIMNET_EXCLUDES(mutex_);
  /// After a break nobody knows how many there are until the hub says so.
  void on_reconnected() GIMNET_EXCLUDES(mutex_);
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

 private:
  /// REQUIRES: the hub refuses it.
  [[nodiscard]] Failure refusal(std::string_view doing) const GIMNET_REQUIRES(mutex_);

  Uplink& uplink_;
  const std::string name_;
  const PublishOptions options_;
  const std::uint32_t epoch_ = Uplink::draw_epoch();  ///< of its stream

  Mutex mutex_;
  Condition changed_;
  std::string full_name_ GIMNET_GUARDED_BY(mutex_);
  std::uint32_t group_ GIMNET_GUARDED_BY(mutex_) = 0;
  Failure refusal_ GIMNET_GUARDED_BY(mutex_){Status::refused, ""};  ///< while it has no group
  std::size_t subscribers_ GIMNET_GUARDED_BY(mutex_) = 0;
  bool subscribers_known_ GIMNET_GUARDED_BY(mutex_) = true;
  std::uint32_t sequence_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::uint64_t published_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::optional<Failure> not_retained_ GIMNET_GUARDED_BY(mutex_);  ///< of the last message
  bool sending_ GIMNET_GUARDED_BY(mutex_) = false;
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

/// A service of another node that this one subscribed, to read it or to know where it is, and the
/// queue of its messages. Thread safety: any thread. Lifetime: the inbox outlives it.
class SubscribedService {
 public:
  SubscribedService(std::string full_name, Inbox& inbox, const QueueOptions& options)
      : name_(new ServiceName(std::move(full_name))), queue_(inbox.add_queue(options)) {}
  ~SubscribedService() { queue_.inbox().remove(queue_); }
  SubscribedService(const SubscribedService&) = delete;
  SubscribedService& operator=(const SubscribedService&) = delete;

  [[nodiscard]] ServiceName& shared_name() const { return *name_; }
  [[nodiscard]] const std::string& name() const { return name_->text; }
  [[nodiscard]] MessageQueue& queue() const { return queue_; }

  /// There is a provider.
  [[nodiscard]] bool exists() GIMNET_EXCLUDES(mutex_);
  /// There is one who takes data under that name: nothing will come.
  [[nodiscard]] bool accepts() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> wait_until_exists(Timeout timeout) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::uint64_t missed() GIMNET_EXCLUDES(mutex_);
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
  /// The message that came last comes once more.
  [[nodiscard]] bool is_repeated(const Position& message) GIMNET_EXCLUDES(mutex_);
  /// What a message would be. Changes nothing.
  [[nodiscard]] StreamEpochs::Step look(const Position& message) GIMNET_EXCLUDES(mutex_);
  /// One of its messages is about to be put into the queue: whoever takes it knows what is missing
  /// before it.
  void count_missed(const Position& message) GIMNET_EXCLUDES(mutex_);
  /// One of its messages is in the queue. REQUIRES: look() is not `former`.
  void on_message(const Position& message) GIMNET_EXCLUDES(mutex_);
  void on_place(const ServicePlace& now) GIMNET_EXCLUDES(mutex_);
  /// The hub did not take the subscription again; until on_place().
  void on_refused(Failure refusal) GIMNET_EXCLUDES(mutex_);
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

  /// Handles of the program that read it; guarded by the table's asking mutex.
  std::size_t handles = 0;
  /// What those asked the hub for; guarded by the table's asking mutex.
  PaceOptions pace;
  /// The queue that the program asked for last; guarded by the table's mutex.
  QueueOptions chosen_queue;
  /// What that is of the service as it is now. REQUIRES: the table's mutex.
  [[nodiscard]] QueueOptions queue_options() const;
  /// A stream of this node leads there; guarded by the table's asking mutex.
  bool followed = false;
  /// What comes is for a queue of the program; guarded by the table's mutex.
  bool read = false;
  /// Where it is; guarded by the table's mutex.
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

  const OwnedServiceName name_;
  MessageQueue& queue_;

  Mutex mutex_;
  Condition changed_;
  bool exists_ GIMNET_GUARDED_BY(mutex_) = false;
  bool accepts_ GIMNET_GUARDED_BY(mutex_) = false;
  std::optional<Failure> refusal_ GIMNET_GUARDED_BY(mutex_);
  Position last_ GIMNET_GUARDED_BY(mutex_);                ///< from nobody: nothing came yet
  Position counted_ GIMNET_GUARDED_BY(mutex_);             ///< by count_missed(), last
  std::vector<Stream> streams_ GIMNET_GUARDED_BY(mutex_);  ///< the one that began last is the last
  std::uint64_t missed_ GIMNET_GUARDED_BY(mutex_) = 0;
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
