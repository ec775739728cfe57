#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>

#include "base/ids.hpp"
#include "base/mutex.hpp"
#include "client/nif/outbound.hpp"
#include "client/nif/session_terms.hpp"

namespace gimnet::nif {

/// Counts of messages that the program took of each group that its hub counts, told to the hub in
/// CREDITs: totals, which are repeated after every WELCOME, so that none is lost (docs/protocol.md,
/// section 8). Both ends count from the answer to the SUBSCRIBE that began the subscription, or
/// from the SERVICE_MOVED that gave it a new group, and anew from a WELCOME that was not `resumed`.
/// Thread safety: take() and tell_missed() from any thread, the rest from the library's. Limits:
/// one account for each group that the hub counts.
class CreditBook {
 public:
  explicit CreditBook(Outbound& outbound) : outbound_(outbound) {}

  /// A connection is about to stand, before the first post on it. Unless it was resumed counts
  /// begin at 0, and no total of the earlier connection is told on this one.
  void begin(const SessionTerms& session) GIMNET_EXCLUDES(mutex_);
  /// A connection stands: what was taken is told (again).
  void tell_all() GIMNET_EXCLUDES(mutex_);
  /// The hub counts this group under that number, with that window; 0: it does not. Counts under
  /// the same number go on.
  void open(GroupId group, std::uint32_t window, std::uint8_t number) GIMNET_EXCLUDES(mutex_);
  /// The subscription is over, or has another group.
  void forget(GroupId group) GIMNET_EXCLUDES(mutex_);
  /// The tag of a message of the group that comes now; 0: it is not counted.
  [[nodiscard]] std::uint32_t epoch_for(std::uint32_t group) GIMNET_EXCLUDES(mutex_);

  /// The program took messages. With `more` the hub is told once half of the window was taken, else
  /// at once.
  void take(std::uint32_t group, std::uint32_t epoch, std::uint32_t messages, bool more)
      GIMNET_EXCLUDES(mutex_);
  /// The program missed so many messages of that group in all. False: there is no connection, or
  /// its hub does not want to know.
  bool tell_missed(GroupId group, std::uint64_t total) GIMNET_EXCLUDES(mutex_);

 private:
  struct Account {
    std::uint8_t number = 0;
    std::uint32_t epoch = 0;  ///< another one each time that its counts begin
    std::uint32_t window = 0;
    std::uint64_t taken = 0;
    std::uint64_t told = 0;
  };
  /// Groups that are not counted and known to be so without the lock.
  static constexpr std::size_t kPlainSlots = 64;
  void restart(Account& account) GIMNET_REQUIRES(mutex_);
  void tell(std::uint32_t group, Account& account) GIMNET_REQUIRES(mutex_);

  Outbound& outbound_;
  // The library's thread: the plain group last seen with that remainder, so that messages of
  // services without a window take no lock.
  std::array<std::uint32_t, kPlainSlots> plain_{};

  Mutex mutex_;
  std::uint32_t epochs_ GIMNET_GUARDED_BY(mutex_) = 0;
  bool takes_missed_ GIMNET_GUARDED_BY(mutex_) = false;  ///< the hub
  std::map<std::uint32_t, Account> accounts_ GIMNET_GUARDED_BY(mutex_);
};

}  // namespace gimnet::nif
