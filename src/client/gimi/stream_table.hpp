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

/// Why a stream cannot be taken by who has those options; nothing if it can: streams share them.
[[nodiscard]] std::optional<Failure> conflict(const SendStream& standing,
                                              const SendOptions& options);

/// All streams that a node sends. Thread safety: any thread. Streams to nodes live as long as the
/// table, those to services until another one needs their place.
class StreamTable final : public StreamKeeper {
 public:
  /// Most (peer, key) that a node can send to in its life, and services that it sends to.
  static constexpr std::size_t kStreamsMax = 65536;
  /// So many services are kept, the latest ones. More only where each has a Sender, or waits for an
  /// ACK. As many as a hub allows one node to subscribe.
  static constexpr std::size_t kServicesKept = 1024;
  using Stream = std::shared_ptr<SendStream>;

  /// `attend` is called without a lock when tick() has something to do soon (false) or at once
  /// (true).
  StreamTable(Uplink& uplink, std::function<void(bool at_once)> attend)
      : uplink_(uplink), attend_(std::move(attend)) {}

  [[nodiscard]] Outcome<Stream> stream(Peer to, const SendOptions& options) GIMNET_EXCLUDES(mutex_);
  /// To the service of that full name, if the node sends there already and somebody has it.
  [[nodiscard]] Stream standing(const std::string& full_name) GIMNET_EXCLUDES(mutex_);
  /// To whoever accepts the service of that full name, which is at `place` now.
  [[nodiscard]] Outcome<Stream> service_stream(const std::string& full_name,
                                               const ServicePlace& place,
                                               const SendOptions& options) GIMNET_EXCLUDES(mutex_);
  /// Before the stream to a service is asked for: where it is a new one and kServicesKept are
  /// there, the one that was asked for longest ago ends, of those that nobody uses. Returns its
  /// name.
  [[nodiscard]] std::optional<std::string> make_place(const std::string& full_name)
      GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] bool has_service(const std::string& full_name) GIMNET_EXCLUDES(mutex_);
  /// From the library's thread: a service that this node follows is there now.
  void on_service_moved(const std::string& full_name, const ServicePlace& place)
      GIMNET_EXCLUDES(mutex_);

  /// `header`: of the answer. One of another epoch is not for this process and changes nothing.
  void on_ack(const StreamName& name, const proto::gimi::MessageHeader& header,
              const proto::gimi::Ack& ack) GIMNET_EXCLUDES(mutex_);
  /// The receiver says that it did not take that DATA, and why. `header`: as on_ack(). False: it is
  /// of no stream.
  [[nodiscard]] bool on_refused(const StreamName& name, const proto::gimi::MessageHeader& header,
                                const Loss& why) GIMNET_EXCLUDES(mutex_);

  /// The hub's word on a frame of this node that it could not deliver.
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
  struct Service {
    Stream stream;
    std::uint64_t asked = 0;  ///< grows with each time that the program asked for one
  };
  [[nodiscard]] Stream find(const StreamName& name) GIMNET_EXCLUDES(mutex_);
  /// Why there cannot be another stream; nothing if there can.
  [[nodiscard]] std::optional<Failure> obstacle(const SendOptions& options) const
      GIMNET_REQUIRES(mutex_);
  [[nodiscard]] std::vector<Stream> all() GIMNET_EXCLUDES(mutex_);

  Uplink& uplink_;
  const std::function<void(bool)> attend_;
  std::atomic<std::int64_t> interrupted_ns_{0};

  Mutex mutex_;
  std::unordered_map<StreamName, Stream, StreamNameHash> streams_ GIMNET_GUARDED_BY(mutex_);
  /// By full name, and of those which are there by group id.
  std::unordered_map<std::string, Service> services_ GIMNET_GUARDED_BY(mutex_);
  std::unordered_map<std::uint32_t, Stream> by_group_ GIMNET_GUARDED_BY(mutex_);
  std::uint64_t asked_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::vector<SendStream*> watched_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
