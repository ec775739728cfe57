#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "base/mutex.hpp"
#include "client/gimi/uplink.hpp"
#include "gimnet/gimi.hpp"

namespace gimnet::gimi {

/// An own service that provides data; its full name is the one it was advertised under. Thread safety: any thread;
/// nothing that is called from the library's thread waits for a thread that publishes.
class PublishedService {
 public:
  PublishedService(Uplink& uplink, std::string name, std::string full_name, const PublishOptions& options)
      : uplink_(uplink), name_(std::move(name)), full_name_(std::move(full_name)), options_(options) {}

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const std::string& full_name() const { return full_name_; }
  [[nodiscard]] Outcome<void> publish(BytesView data, More more) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::size_t subscribers() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> wait_for_subscribers(std::size_t count, Timeout timeout) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::uint64_t published() GIMNET_EXCLUDES(mutex_);

  void on_group(std::uint32_t group) GIMNET_EXCLUDES(mutex_);
  void on_subscribers(std::size_t count) GIMNET_EXCLUDES(mutex_);
  /// After a break nobody knows how many there are until the hub says so.
  void on_reconnected() GIMNET_EXCLUDES(mutex_);
  void close() GIMNET_EXCLUDES(mutex_);

 private:
  Uplink& uplink_;
  const std::string name_;
  const std::string full_name_;
  const PublishOptions options_;

  Mutex mutex_;
  Condition changed_;
  std::uint32_t group_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::size_t subscribers_ GIMNET_GUARDED_BY(mutex_) = 0;
  bool subscribers_known_ GIMNET_GUARDED_BY(mutex_) = true;
  std::uint32_t sequence_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::uint64_t published_ GIMNET_GUARDED_BY(mutex_) = 0;
  bool sending_ GIMNET_GUARDED_BY(mutex_) = false;
  bool closed_ GIMNET_GUARDED_BY(mutex_) = false;
};

}  // namespace gimnet::gimi
