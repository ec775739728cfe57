#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/send_stream.hpp"

namespace gimnet::gimi {

/// All streams that a node sends. Thread safety: any thread. Streams live as long as the table.
class StreamTable final : public StreamKeeper {
 public:
  /// Most (peer, key) and services that a node can send to in its life.
  static constexpr std::size_t kStreamsMax = 65536;

  /// `attend` is called without a lock when tick() has something to do soon (false) or at once
  /// (true).
  StreamTable(Uplink& uplink, std::function<void(bool at_once)> attend)
      : uplink_(uplink), attend_(std::move(attend)) {}

  [[nodiscard]] Outcome<SendStream*> stream(Peer to, const SendOptions& options)
      GIMNET_EXCLUDES(mutex_);
  /// To whoever accepts the service of that full name, which is at `place` now.
  [[nodiscard]] Outcome<SendStream*> service_stream(const std::string& full_name,
                                                    const ServicePlace& place,
                                                    const SendOptions& options)
      GIMNET_EXCLUDES(mutex_);
  /// From the library's thread: a service that this node follows is there now.
  void on_service_moved(const std::string& full_name, const ServicePlace& place)
      GIMNET_EXCLUDES(mutex_);

  /// `header`: of the answer. One of another epoch is not for this process and changes nothing.
  void on_ack(const StreamName& name, const proto::gimi::MessageHeader& header,
              const proto::gimi::Ack& ack) GIMNET_EXCLUDES(mutex_);
  /// The receiver says that it did not take that DATA, and why. `header`: as on_ack().
  void on_refused(const StreamName& name, const proto::gimi::MessageHeader& header, const Loss& why)
      GIMNET_EXCLUDES(mutex_);

  /// What the hub says of a frame of this node that it could not deliver.
  struct Report {
    StreamName name;
    bool has_key = true;  ///< false: it may be any stream to that peer; of a group there is one
    std::uint32_t reason = 0;
    std::uint64_t count = 1;
    std::uint32_t sequence = 0;  ///< of the DATA; 0: not known
    std::uint32_t epoch = 0;     ///< of the DATA, if the sequence is known
    std::string text;
  };
  void on_report(const Report& report) GIMNET_EXCLUDES(mutex_);
  /// The hub could not deliver some frames, and does not say which.
  void on_doubt(const Loss& why) GIMNET_EXCLUDES(mutex_);
  /// Everything that waits is lost, or nobody will ever tell.
  void on_broken(const Loss& why) GIMNET_EXCLUDES(mutex_);
  /// The connection broke at that time, and what waits may still be saved by a resume; 0: it is
  /// there again. When that takes longer than a hub keeps a session, tick() gives up what waits.
  void on_interrupted(std::int64_t since_ns) { interrupted_ns_.store(since_ns); }
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

  /// False: no stream waits for anything. One thread at a time.
  [[nodiscard]] bool tick(std::int64_t now_ns) GIMNET_EXCLUDES(mutex_);
  void watch(SendStream& stream) override GIMNET_EXCLUDES(mutex_);

 private:
  [[nodiscard]] SendStream* find(const StreamName& name) GIMNET_EXCLUDES(mutex_);
  /// Why there cannot be another stream; nothing if there can.
  [[nodiscard]] std::optional<Failure> obstacle(const SendOptions& options) const
      GIMNET_REQUIRES(mutex_);
  [[nodiscard]] std::vector<SendStream*> all() GIMNET_EXCLUDES(mutex_);

  Uplink& uplink_;
  const std::function<void(bool)> attend_;
  std::atomic<std::int64_t> interrupted_ns_{0};

  Mutex mutex_;
  std::unordered_map<StreamName, std::unique_ptr<SendStream>, StreamNameHash> streams_
      GIMNET_GUARDED_BY(mutex_);
  /// By full name, and of those which are there by group id.
  std::unordered_map<std::string, std::unique_ptr<SendStream>> services_ GIMNET_GUARDED_BY(mutex_);
  std::unordered_map<std::uint32_t, SendStream*> by_group_ GIMNET_GUARDED_BY(mutex_);
  std::vector<SendStream*> watched_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
