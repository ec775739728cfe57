#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/stream_table.hpp"
#include "client/gimi/uplink.hpp"
#include "client/gimi/wait_set.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi/requests.hpp"
#include "proto/gimi/request.hpp"

namespace gimnet::gimi {

/// The end of a request: a reply, or why there is none.
struct Ended {
  Status status = Status::ok;
  std::string sentence;  ///< of a status that is not ok
  Ran ran = Ran::yes;
  std::int32_t code = 0;  ///< of Status::failed, as the other program chose it
  Message message;        ///< of Status::ok

  [[nodiscard]] explicit operator bool() const { return status == Status::ok; }
};

/// Requests of this node that have not ended, and the services that it asked. Each ends in exactly
/// one way, and says whether the other program may have done the work. Thread safety: any thread;
/// on_*() from the library's thread. Limits: kOpenMax, kServicesMax.
class OpenRequests {
 public:
  static constexpr std::size_t kOpenMax = 1024;
  /// Services whose place is kept. Beyond them the one that was asked longest ago is forgotten.
  static constexpr std::size_t kServicesMax = 64;
  /// A request that found no way is sent again after each of these ...
  static constexpr std::int64_t kRetryNs = 100'000'000;
  /// ... for so long.
  static constexpr std::int64_t kRetryForNs = 2'000'000'000;

  /// `attend` is called without a lock when tick() has something to do soon.
  OpenRequests(Uplink& uplink, std::function<void()> attend)
      : uplink_(uplink), attend_(std::move(attend)) {}

  /// In each request of this node.
  [[nodiscard]] std::uint32_t epoch() const { return epoch_; }

  /// Is the place of the service known, and does somebody answer there?
  [[nodiscard]] bool knows(const std::string& service) GIMNET_EXCLUDES(mutex_);
  /// Waits until then, or until that is so, or nothing can come any more.
  void wait_for_place(const std::string& service, std::int64_t until_ns) GIMNET_EXCLUDES(mutex_);
  /// The service is at `place`; what changes comes to on_service_moved() while `stream` lives.
  void learn(const std::string& service, StreamTable::Stream stream, const ServicePlace& place)
      GIMNET_EXCLUDES(mutex_);

  /// Sends a request; its number. Errors: limit, closed.
  [[nodiscard]] Outcome<std::uint32_t> open(const std::string& service, BytesView data,
                                            std::int64_t deadline_ns, const RequestOptions& options)
      GIMNET_EXCLUDES(mutex_);
  /// The end of a request, once; nothing if it has not ended by then. `left`: set by leave(), in
  /// which case the answer is `closed`.
  [[nodiscard]] std::optional<Ended> wait(std::uint32_t number, std::int64_t until_ns,
                                          const std::atomic<bool>* left = nullptr)
      GIMNET_EXCLUDES(mutex_);
  /// Nobody waits for it any more.
  void cancel(std::uint32_t number) GIMNET_EXCLUDES(mutex_);
  /// Sets `left` and has those that wait with it leave.
  void leave(std::atomic<bool>& left) GIMNET_EXCLUDES(mutex_);
  /// A WaitSet waits for the end of that request here. False: it was given.
  [[nodiscard]] bool visit(std::uint32_t number, const SourceVisitor& visitor)
      GIMNET_EXCLUDES(mutex_);

  /// True: it took the message, with its storage. `reply` is empty if it is too large.
  [[nodiscard]] bool on_reply(const proto::gimi::MessageHeader& header, Message& reply,
                              bool too_large) GIMNET_EXCLUDES(mutex_);
  /// False: no request that this node was asked waits for it.
  [[nodiscard]] bool on_error(const proto::gimi::MessageHeader& header, Peer from,
                              const proto::gimi::RequestError& error) GIMNET_EXCLUDES(mutex_);
  /// The hub could not deliver it.
  void on_report(std::uint32_t sequence, std::uint32_t reason, const std::string& words)
      GIMNET_EXCLUDES(mutex_);
  void on_service_moved(const std::string& service, const ServicePlace& place)
      GIMNET_EXCLUDES(mutex_);
  /// The connection broke without resume: what was sent, and its answer, may be lost.
  void on_broken() GIMNET_EXCLUDES(mutex_);
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);
  /// Sends again what is due. False: nothing is to be sent again. One thread at a time.
  [[nodiscard]] bool tick(std::int64_t now_ns) GIMNET_EXCLUDES(mutex_);
  /// Replies that nobody waits for, or of a wrong node.
  [[nodiscard]] std::uint64_t dropped() GIMNET_EXCLUDES(mutex_);

 private:
  struct Service {
    StreamTable::Stream stream;
    ServicePlace place;
    std::uint64_t asked = 0;
  };
  /// The bytes of a request, which goes without the lock while others look at it.
  using Data = std::shared_ptr<const std::vector<std::byte>>;
  struct Open {
    std::string service;
    Data data;
    Lane lane = Lane::normal;
    bool repeat = false;
    std::int64_t deadline_ns = 0;
    std::int64_t again_ns = 0;    ///< not 0: it is to be sent then
    std::int64_t give_up_ns = 0;  ///< until then it is sent again; 0: it has found its way so far
    std::uint32_t provider = 0;   ///< to whom it was sent last; 0: nobody yet
    std::uint64_t session = 0;    ///< of the provider
    std::uint32_t instance = 0;   ///< of the service: each program draws another one
    bool sent = false;            ///< the last time, and nobody said that it did not arrive
    bool unsure = false;          ///< it was sent before that, and nobody knows what became of it
    std::optional<Ended> reply;
    WaitSource source;

    [[nodiscard]] bool may_have_come() const { return sent || unsure; }
    /// Of an end without an answer.
    [[nodiscard]] Ran ran() const { return may_have_come() ? Ran::maybe : Ran::no; }
  };
  struct Sending {
    Envelope envelope;
    proto::gimi::MessageHeader header;
    Data data;
  };
  [[nodiscard]] std::optional<Sending> prepare(std::uint32_t number, Open& open,
                                               std::int64_t now_ns) GIMNET_REQUIRES(mutex_);
  void transmit(std::uint32_t number, const Sending& sending, std::int32_t timeout_ms)
      GIMNET_EXCLUDES(mutex_);
  void finish(Open& open, Ended reply) GIMNET_REQUIRES(mutex_);
  void time_out(Open& open) GIMNET_REQUIRES(mutex_);
  /// Nobody answers there now: it waits for its time if the service is away, else as retry().
  void find_nobody(Open& open, std::int64_t now_ns) GIMNET_REQUIRES(mutex_);
  /// It found no way: sends it again soon, or ends it if that went on for too long.
  void retry(Open& open, Ended otherwise) GIMNET_REQUIRES(mutex_);
  /// The program that was asked has gone. One that may be done twice waits for the next one.
  void ask_the_next(Open& open, bool is_there) GIMNET_REQUIRES(mutex_);
  [[nodiscard]] bool knows_locked(const std::string& service) const GIMNET_REQUIRES(mutex_);
  [[nodiscard]] Open* find(const proto::gimi::MessageHeader& header, Peer from)
      GIMNET_REQUIRES(mutex_);

  Uplink& uplink_;
  const std::function<void()> attend_;
  const std::uint32_t epoch_ = Uplink::draw_epoch();

  Mutex mutex_;
  Condition ended_;
  std::map<std::string, Service, std::less<>> services_ GIMNET_GUARDED_BY(mutex_);
  std::map<std::uint32_t, Open> open_ GIMNET_GUARDED_BY(mutex_);
  std::uint32_t next_ GIMNET_GUARDED_BY(mutex_) = 1;
  std::uint64_t asked_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::uint64_t dropped_ GIMNET_GUARDED_BY(mutex_) = 0;
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
