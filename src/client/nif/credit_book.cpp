#include "client/nif/credit_book.hpp"

#include <algorithm>

namespace gimnet::nif {

void CreditBook::begin(bool resumed) {
  plain_.fill(0);
  const MutexLock lock(mutex_);
  if (resumed) {
    std::erase_if(accounts_, [](const auto& entry) { return entry.second.state == State::plain; });
    return;
  }
  ++epoch_;
  std::erase_if(accounts_, [](const auto& entry) { return entry.second.state != State::counted; });
  for (auto& [group, account] : accounts_) account.taken = account.told = 0;
}

void CreditBook::tell_all() {
  const MutexLock lock(mutex_);
  for (auto& [group, account] : accounts_) {
    if (account.taken != 0 && account.state == State::counted) tell(group, account);
  }
}

void CreditBook::open(GroupId group, std::uint32_t window) {
  if (group == GroupId{}) return;
  plain_.fill(0);
  const MutexLock lock(mutex_);
  const auto found = accounts_.find(group.value());
  if (found == accounts_.end() && window == 0 && accounts_.size() >= kAccountsMax) return;
  Account& account = accounts_[group.value()];
  if (window == 0 && account.state != State::counted) {
    account = {State::plain, 0, 0, 0};
    return;
  }
  account.window = window;
  account.state = State::counted;
  if (account.taken != account.told) tell(group.value(), account);
}

void CreditBook::forget(GroupId group) {
  plain_.fill(0);
  const MutexLock lock(mutex_);
  accounts_.erase(group.value());
}

std::uint32_t CreditBook::epoch_for(std::uint32_t group) {
  std::uint32_t& plain = plain_[group % kPlainSlots];
  if (plain == group) return 0;  // also for 0, which no group has
  const MutexLock lock(mutex_);
  const auto found = accounts_.find(group);
  if (found == accounts_.end()) {
    if (accounts_.size() >= kAccountsMax) {
      // Of subscriptions that ended nobody tells. Plain ones that go on count early then, which
      // nobody is told.
      std::erase_if(accounts_,
                    [](const auto& entry) { return entry.second.state != State::counted; });
      if (accounts_.size() >= kAccountsMax) return 0;
    }
    accounts_.emplace(group, Account{});
    return epoch_;
  }
  if (found->second.state != State::plain) return epoch_;
  plain = group;
  return 0;
}

void CreditBook::take(std::uint32_t group, std::uint32_t epoch, std::uint32_t messages, bool more) {
  if (epoch == 0) return;
  const MutexLock lock(mutex_);
  const auto found = accounts_.find(group);
  if (found == accounts_.end() || epoch != epoch_) return;
  Account& account = found->second;
  if (account.state == State::plain) return;
  account.taken += messages;
  if (account.state == State::early) return;
  const std::uint64_t enough = more ? std::max(1u, account.window / 2) : 1;
  if (account.taken - account.told >= enough) tell(group, account);
}

void CreditBook::tell(std::uint32_t group, Account& account) {
  // Not connected: the next WELCOME brings it.
  if (outbound_.post(proto::flow::Credit{GroupId{group}, account.taken}))
    account.told = account.taken;
}

}  // namespace gimnet::nif
