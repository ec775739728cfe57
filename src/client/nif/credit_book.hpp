#pragma once

#include <atomic>
#include <cstdint>
#include <map>

#include "base/ids.hpp"
#include "base/mutex.hpp"
#include "client/nif/outbound.hpp"

namespace gimnet::nif {

/// How many messages the program took of each group that its hub counts, told to the hub in CREDITs: totals, which are
/// repeated after every WELCOME, so that none is lost (docs/protocol.md, section 8). An epoch is the time between two
/// WELCOMEs that were not `resumed`: with each the counts begin at 0.
/// Thread safety: take() from any thread, the rest from the library's.
class CreditBook {
 public:
  explicit CreditBook(Outbound& outbound) : outbound_(outbound) {}

  /// A connection that was not resumed is about to stand: counts begin at 0. Before the first post on it, so that no
  /// total of the earlier one is told there.
  void begin_anew() GIMNET_EXCLUDES(mutex_);
  /// A connection stands: what was taken is told (again).
  void tell_all() GIMNET_EXCLUDES(mutex_);
  /// The hub counts this group, with that window; 0: it does not. Counts of an earlier subscription go on.
  void open(GroupId group, std::uint32_t window) GIMNET_EXCLUDES(mutex_);
  /// The group is gone.
  void forget(GroupId group) GIMNET_EXCLUDES(mutex_);
  /// What a message of the group that comes now is tagged with; 0: it is not counted. `subscribing`: a SUBSCRIBE waits
  /// for its answer. The hub may send messages before that, and counts them: so they are counted until open() says
  /// whether it does.
  [[nodiscard]] std::uint32_t epoch_for(std::uint32_t group, bool subscribing) GIMNET_EXCLUDES(mutex_);

  /// The program took messages. With `more` the hub is told once half of the window was taken, else at once.
  void take(std::uint32_t group, std::uint32_t epoch, std::uint32_t messages, bool more) GIMNET_EXCLUDES(mutex_);

 private:
  struct Account {
    std::uint32_t window = 0;
    std::uint64_t taken = 0;
    std::uint64_t told = 0;
    bool early = false;  ///< not open yet: counted, but not told
  };
  /// Groups of which something came early, at most.
  static constexpr std::size_t kAccountsMax = 4096;
  void tell(std::uint32_t group, Account& account) GIMNET_REQUIRES(mutex_);

  Outbound& outbound_;
  std::atomic<bool> any_{false};

  Mutex mutex_;
  std::uint32_t epoch_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::map<std::uint32_t, Account> accounts_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::nif
