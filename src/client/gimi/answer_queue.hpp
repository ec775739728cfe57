#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <string>
#include <unordered_set>
#include <vector>

#include "base/mutex.hpp"
#include "client/gimi/ending.hpp"
#include "client/gimi/uplink.hpp"
#include "client/gimi/wait_set.hpp"
#include "gimnet/gimi/message.hpp"
#include "gimnet/gimi/outcome.hpp"
#include "proto/gimi/request.hpp"

namespace gimnet::gimi {

/// A request that the program takes.
struct TakenRequest {
  Message message;           ///< its data are those of the program
  std::uint64_t name = 0;    ///< epoch and sequence
  std::int64_t left_ms = 0;  ///< until nobody waits any more; -1: no limit
};

/// The requests to one own service that answers, and what became of the last ones. Thread safety:
/// any thread; on_request() from the library's. Limits: kWaitingMax, kNamesMax, kAnswersMax and
/// kAnswerBytesMax.
class AnswerQueue {
 public:
  /// Requests that wait for the program. Further ones are refused `busy`.
  static constexpr std::size_t kWaitingMax = 64;
  /// Requests of which it is known that they came.
  static constexpr std::size_t kNamesMax = 1024;
  /// Answers that are kept, to be sent again to who asks again.
  static constexpr std::size_t kAnswersMax = 64;
  static constexpr std::size_t kAnswerBytesMax = std::size_t{1} << 20;

  /// `bytes_max`: of requests that wait. Beyond it further ones are refused `busy`, too.
  AnswerQueue(Uplink& uplink, std::string service, std::size_t bytes_max)
      : uplink_(uplink), service_(std::move(service)), bytes_max_(bytes_max) {}
  [[nodiscard]] const std::string& service() const { return service_; }

  /// Takes the oldest request whose time is not over. Errors: timeout, closed.
  [[nodiscard]] Outcome<TakenRequest> receive(Timeout timeout) GIMNET_EXCLUDES(mutex_);
  /// A WaitSet waits for a request here, which may be too late when it is taken.
  void visit(const SourceVisitor& visitor) GIMNET_EXCLUDES(mutex_);
  /// Answers a request that was taken: once. Errors: closed (it has been answered, or the node
  /// was closed), and those of sending, after which it can be answered again.
  [[nodiscard]] Outcome<void> reply(std::uint64_t name, BytesView data, Timeout timeout)
      GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] Outcome<void> fail(std::uint64_t name, const proto::gimi::RequestError& error)
      GIMNET_EXCLUDES(mutex_);
  /// The program has done with it: if it did not answer, the asking program is told so.
  void let_go(std::uint64_t name) GIMNET_EXCLUDES(mutex_);

  /// True: it keeps the message, with its storage. `left_ms`: as the request says.
  [[nodiscard]] bool on_request(const proto::gimi::MessageHeader& header, Message& message,
                                std::uint32_t left_ms) GIMNET_EXCLUDES(mutex_);
  /// No program takes requests any more: those that wait are refused.
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

 private:
  struct Waiting {
    Message message;
    std::uint64_t name = 0;
    std::int64_t deadline_ns = 0;
  };
  /// The way of the answer.
  struct Way {
    Peer to;
    Lane lane = Lane::normal;
    MessageKey key;
  };
  struct Open {
    Way way;
    bool is_being_answered = false;
    bool came_again = false;  ///< since its answer was given away
  };
  struct Answer {
    std::uint64_t name = 0;
    proto::gimi::MessageOperation operation{};
    std::vector<std::byte> data;
  };
  [[nodiscard]] nif_status send(const Way& way, std::uint64_t name,
                                proto::gimi::MessageOperation operation, BytesView data,
                                std::int32_t timeout_ms) const;
  void refuse(const Way& way, std::uint64_t name, proto::gimi::RequestFault fault) const;
  [[nodiscard]] Outcome<void> answer(std::uint64_t name, proto::gimi::MessageOperation operation,
                                     BytesView data, Timeout timeout) GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] bool is_full() const GIMNET_REQUIRES(mutex_) {
    return waiting_.size() >= kWaitingMax || waiting_bytes_ >= bytes_max_;
  }
  /// Nobody waits for these any more.
  void drop_late() GIMNET_REQUIRES(mutex_);
  /// It was answered so.
  void close(std::uint64_t name, proto::gimi::MessageOperation operation, BytesView data)
      GIMNET_REQUIRES(mutex_);
  void keep(Answer answer) GIMNET_REQUIRES(mutex_);
  void remember(std::uint64_t name) GIMNET_REQUIRES(mutex_);

  Uplink& uplink_;
  const std::string service_;
  const std::size_t bytes_max_;

  Mutex mutex_;
  Condition filled_;
  WaitSource source_ GIMNET_GUARDED_BY(mutex_);
  std::deque<Waiting> waiting_ GIMNET_GUARDED_BY(mutex_);  ///< Limit: kWaitingMax, bytes_max_
  std::size_t waiting_bytes_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::map<std::uint64_t, Open> open_ GIMNET_GUARDED_BY(mutex_);      ///< not answered
  std::deque<std::uint64_t> names_ GIMNET_GUARDED_BY(mutex_);         ///< Limit: kNamesMax
  std::unordered_set<std::uint64_t> came_ GIMNET_GUARDED_BY(mutex_);  ///< the same
  std::deque<Answer> answers_ GIMNET_GUARDED_BY(mutex_);              ///< Limit: kAnswersMax
  std::size_t answer_bytes_ GIMNET_GUARDED_BY(mutex_) = 0;
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

/// The services of a node that answer, by the instance of their key. That is drawn at random: a
/// request that is asked again never reaches a program that was started since. Thread safety: any
/// thread. Limits: those of the hub.
class AnswerTable {
 public:
  /// `bytes_max`: of the requests that wait at one service.
  AnswerTable(Uplink& uplink, std::size_t bytes_max) : uplink_(uplink), bytes_max_(bytes_max) {}

  struct Added {
    std::shared_ptr<AnswerQueue> queue;
    MessageKey key;
  };
  [[nodiscard]] Added add(const std::string& full_name) GIMNET_EXCLUDES(mutex_);
  void remove(MessageKey key) GIMNET_EXCLUDES(mutex_);
  /// Null: no such service.
  [[nodiscard]] std::shared_ptr<AnswerQueue> find(MessageKey key) GIMNET_EXCLUDES(mutex_);
  void end(const Ending& ending) GIMNET_EXCLUDES(mutex_);

 private:
  Uplink& uplink_;
  const std::size_t bytes_max_;
  Mutex mutex_;
  std::map<std::uint32_t, std::shared_ptr<AnswerQueue>> queues_ GIMNET_GUARDED_BY(mutex_);
  Ending end_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::gimi
