#pragma once

#include <atomic>
#include <list>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "base/result.hpp"
#include "hub/concurrent/waker.hpp"
#include "hub/control/link_options.hpp"
#include "hub/network/state/network_map.hpp"
#include "net/dial.hpp"

namespace gimnet::hub {

/// Dials links, each attempt on a thread of its own, since a host look-up may block and few links
/// are dialled at a time. Thread safety: the conductor's thread only; its own threads block all
/// signals. Ownership: of its threads, which the destructor ends without waiting for a peer.
class LinkDialler {
 public:
  using Outcome = Result<net::Welcomed, net::NetError>;
  /// An attempt ends after so long.
  static constexpr std::int64_t kAttemptNs = std::int64_t{5'000} * net::kNsPerMs;

  LinkDialler() = default;
  ~LinkDialler();
  LinkDialler(const LinkDialler&) = delete;
  LinkDialler& operator=(const LinkDialler&) = delete;

  void dial(LinkNumber link, const DialledLink& to, const proto::Hello& hello,
            const net::SocketOptions& options);
  /// Its descriptor becomes readable when take_ended() has something, after prepare_to_sleep().
  [[nodiscard]] Waker& waker() { return waker_; }
  [[nodiscard]] std::vector<std::pair<LinkNumber, Outcome>> take_ended();

 private:
  struct Attempt {
    LinkNumber link;
    std::thread thread;
    std::atomic<bool> ended{false};
  };
  void end(LinkNumber link, Outcome outcome);
  void note(Attempt& attempt, Outcome outcome);

  net::WakeSignal cancel_;
  Waker waker_;
  std::list<Attempt> attempts_;  ///< the conductor's. Limit: one for each link that is dialled
  std::mutex mutex_;
  std::vector<std::pair<LinkNumber, Outcome>> ended_;  ///< guarded by mutex_
};

}  // namespace gimnet::hub
