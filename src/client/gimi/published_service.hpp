#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "base/mutex.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/uplink.hpp"
#include "client/gimi/wait_set.hpp"
#include "gimnet/gimi/handles.hpp"
#include "gimnet/gimi/options.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "proto/gimi/message_header.hpp"

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
  /// The present full name; without the node's name while the node has none.
  [[nodiscard]] std::string full_name() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> publish(BytesView data, Timeout timeout, More more)
      GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::size_t subscribers() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> wait_for_subscribers(std::size_t count, Timeout timeout)
      GIMNET_EXCLUDES(mutex_);
  /// Waits until their number is another one than this told last; it tells at once at first.
  [[nodiscard]] Outcome<std::size_t> subscribers_changed(Timeout timeout) GIMNET_EXCLUDES(mutex_);
  /// A WaitSet waits for what subscribers_changed() tells.
  void visit(const SourceVisitor& visitor) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::uint64_t published() GIMNET_EXCLUDES(mutex_);
  /// Dropped, since the hub was away.
  [[nodiscard]] std::uint64_t unsent() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> standing() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> retained() GIMNET_EXCLUDES(mutex_);

  /// 0: the hub refuses it at the moment.
  [[nodiscard]] std::uint32_t group() GIMNET_EXCLUDES(mutex_);
  void on_group(std::uint32_t group) GIMNET_EXCLUDES(mutex_);
  /// The hub refused the service; `refusal` has its words.
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
  /// subscribers_changed() would answer at once.
  [[nodiscard]] bool has_news() const GIMNET_REQUIRES(mutex_) {
    return told_subscribers_ != subscribers_ || end_;
  }

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
  std::optional<std::size_t> told_subscribers_
      GIMNET_GUARDED_BY(mutex_);  ///< by subscribers_changed(), last
  WaitSource source_ GIMNET_GUARDED_BY(mutex_);
  std::uint32_t sequence_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::uint64_t published_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::uint64_t unsent_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::optional<Failure> not_retained_ GIMNET_GUARDED_BY(mutex_);  ///< of the last message
  bool sending_ GIMNET_GUARDED_BY(mutex_) = false;
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
