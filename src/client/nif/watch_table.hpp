#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "base/mutex.hpp"
#include "client/nif/request_table.hpp"
#include "client/nif/storage.hpp"
#include "proto/control/ns_watch.hpp"

namespace gimnet::nif {

/// The own watches: acknowledges what the hub tells, sees gaps, and begins the watches again after
/// a reconnect, where they were if the hub can. Thread safety: add and remove from any thread; the
/// rest from the library's.
class WatchTable {
 public:
  explicit WatchTable(RequestTable& requests) : requests_(requests) {}
  ~WatchTable();

  /// The request to begin a watch with, under a number of its own.
  [[nodiscard]] proto::ns::Watch add(std::string pattern, std::uint8_t subjects, bool by_hand)
      GIMNET_EXCLUDES(mutex_);
  /// The request to begin a watch anew; number 0: there is no such watch.
  [[nodiscard]] proto::ns::Watch again(std::uint32_t number) GIMNET_EXCLUDES(mutex_);
  /// False: there is none.
  bool remove(std::uint32_t number) GIMNET_EXCLUDES(mutex_);

  /// One more frame of that watch was taken: the hub may send another. It is told later where
  /// numbers for requests are short. Any thread.
  void taken(std::uint32_t number) GIMNET_EXCLUDES(mutex_);

  /// The hub's news. True: the program is to have it; false: it is of no watch, or behind a gap,
  /// after which the watch begins anew.
  [[nodiscard]] bool on_events(const proto::ns::WatchEvents& events) GIMNET_EXCLUDES(mutex_);
  /// A new connection.
  void declare_again() GIMNET_EXCLUDES(mutex_);
  /// Goes on where numbers for requests were short.
  void go_on() GIMNET_EXCLUDES(mutex_);
  /// News for the program of a watch that the hub did not take again, after its answer.
  /// Takes the references along.
  [[nodiscard]] std::vector<Item> take_events();

 private:
  struct Watch {
    proto::ns::Watch request;  ///< with the epoch and version that were told last
    bool by_hand = false;      ///< the program says what it took
    bool has_begun = false;    ///< false: what comes is of an earlier life of it, or behind a gap
    std::uint32_t untold = 0;  ///< frames taken of which the hub is still to be told
  };
  [[nodiscard]] bool follows(const proto::ns::WatchEvents& events, bool& by_hand)
      GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] bool tell_taken(std::uint32_t number, std::uint32_t frames);
  void tell_all_taken() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] bool declare(std::uint32_t number) GIMNET_EXCLUDES(mutex_);
  void on_answer(std::uint32_t number, const proto::Payload& payload) GIMNET_EXCLUDES(mutex_);

  RequestTable& requests_;
  Mutex mutex_;
  std::map<std::uint32_t, Watch> watches_ GIMNET_GUARDED_BY(mutex_);
  std::uint32_t last_number_ GIMNET_GUARDED_BY(mutex_) = 0;

  // The library's thread.
  std::deque<std::uint32_t> due_;  ///< each once. Limit: the node's watches
  std::vector<Item> events_;
};

/// The program's view of one change: a record with all that it points to. REQUIRES:
/// `change` is one of `events`.
[[nodiscard]] Record* make_watched(const proto::ns::WatchEvents& events,
                                   const proto::ns::Change& change);

}  // namespace gimnet::nif
