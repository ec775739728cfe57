#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>

#include "base/ids.hpp"
#include "base/mutex.hpp"
#include "client/nif/outbound.hpp"

namespace gimnet::nif {

/// How many messages the program took of each group that its hub counts, told to the hub in
/// CREDITs: totals, which are repeated after every WELCOME, so that none is lost (docs/protocol.md,
/// section 8). An epoch is the time between two WELCOMEs that were not `resumed`: with each the
/// counts begin at 0. Thread safety: take() from any thread, the rest from the library's.
class CreditBook {
 public:
  explicit CreditBook(Outbound& outbound) : outbound_(outbound) {}

  /// A connection is about to stand, before the first post on it: which groups have no window is
  /// not known any more, since the hub could not tell what changed meanwhile. Unless it was
  /// `resumed` counts begin at 0, and no total of the earlier connection is told on this one.
  void begin(bool resumed) GIMNET_EXCLUDES(mutex_);
  /// A connection stands: what was taken is told (again).
  void tell_all() GIMNET_EXCLUDES(mutex_);
  /// The hub counts this group, with that window; 0: it does not, unless it did. Counts of an
  /// earlier subscription go on.
  void open(GroupId group, std::uint32_t window) GIMNET_EXCLUDES(mutex_);
  /// The group is gone.
  void forget(GroupId group) GIMNET_EXCLUDES(mutex_);
  /// What a message of the group that comes now is tagged with; 0: it is not counted. The hub may
  /// send messages before its answer to SUBSCRIBE, and counts them; after a reconnect even before
  /// the SUBSCRIBE. So messages of a group of which nothing is known are counted until open() says
  /// whether the hub does.
  [[nodiscard]] std::uint32_t epoch_for(std::uint32_t group) GIMNET_EXCLUDES(mutex_);

  /// The program took messages. With `more` the hub is told once half of the window was taken, else
  /// at once.
  void take(std::uint32_t group, std::uint32_t epoch, std::uint32_t messages, bool more)
      GIMNET_EXCLUDES(mutex_);

 private:
  enum class State : std::uint8_t {
    early,    ///< not open yet: counted, but not told
    counted,  ///< by the hub, too
    plain,    ///< opened without a window: not counted
  };
  struct Account {
    State state = State::early;
    std::uint32_t window = 0;
    std::uint64_t taken = 0;
    std::uint64_t told = 0;
  };
  /// Groups, at most, but for those that the hub counts, which stay: all others make way for one
  /// more.
  static constexpr std::size_t kAccountsMax = 4096;
  /// Plain groups that are known without the lock.
  static constexpr std::size_t kPlainSlots = 64;
  void tell(std::uint32_t group, Account& account) GIMNET_REQUIRES(mutex_);

  Outbound& outbound_;
  // The library's thread: the plain group last seen with that remainder, so that messages of
  // services without a window take no lock.
  std::array<std::uint32_t, kPlainSlots> plain_{};

  Mutex mutex_;
  std::uint32_t epoch_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::map<std::uint32_t, Account> accounts_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::nif
