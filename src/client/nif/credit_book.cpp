#include "client/nif/credit_book.hpp"

#include <algorithm>

namespace gimnet::nif {

void CreditBook::begin_anew() {
  const MutexLock lock(mutex_);
  ++epoch_;
  std::erase_if(accounts_, [](const auto& entry) { return entry.second.early; });
  for (auto& [group, account] : accounts_) account.taken = account.told = 0;
}

void CreditBook::tell_all() {
  const MutexLock lock(mutex_);
  for (auto& [group, account] : accounts_) {
    if (account.taken != 0 && !account.early) tell(group, account);
  }
}

void CreditBook::open(GroupId group, std::uint32_t window) {
  if (group == GroupId{}) return;
  const MutexLock lock(mutex_);
  const auto found = accounts_.find(group.value());
  if (window == 0 && (found == accounts_.end() || found->second.early)) {
    if (found != accounts_.end()) accounts_.erase(found);
    return;
  }
  Account& account = accounts_[group.value()];
  account.window = window;
  account.early = false;
  if (account.taken != account.told) tell(group.value(), account);
  any_.store(true, std::memory_order_relaxed);  // a hint for this thread, which sets and reads it
}

void CreditBook::forget(GroupId group) {
  const MutexLock lock(mutex_);
  accounts_.erase(group.value());
}

std::uint32_t CreditBook::epoch_for(std::uint32_t group, bool subscribing) {
  if (!subscribing && !any_.load(std::memory_order_relaxed)) return 0;  // see open()
  const MutexLock lock(mutex_);
  if (accounts_.contains(group)) return epoch_;
  if (!subscribing || accounts_.size() >= kAccountsMax) return 0;
  accounts_[group].early = true;
  return epoch_;
}

void CreditBook::take(std::uint32_t group, std::uint32_t epoch, std::uint32_t messages, bool more) {
  if (epoch == 0) return;
  const MutexLock lock(mutex_);
  const auto found = accounts_.find(group);
  if (found == accounts_.end() || epoch != epoch_) return;
  Account& account = found->second;
  account.taken += messages;
  if (account.early) return;
  const std::uint64_t enough = more ? std::max(1u, account.window / 2) : 1;
  if (account.taken - account.told >= enough) tell(group, account);
}

void CreditBook::tell(std::uint32_t group, Account& account) {
  // Not connected: the next WELCOME brings it.
  if (outbound_.post(proto::flow::Credit{GroupId{group}, account.taken})) account.told = account.taken;
}

}  // namespace gimnet::nif
