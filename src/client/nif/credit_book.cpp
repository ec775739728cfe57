#include "client/nif/credit_book.hpp"

#include <algorithm>

namespace gimnet::nif {

void CreditBook::begin(const SessionTerms& session) {
  const MutexLock lock(mutex_);
  takes_missed_ = session.takes_missed;
  if (session.resumed) return;
  for (auto& [group, account] : accounts_) restart(account);
}

void CreditBook::tell_all() {
  const MutexLock lock(mutex_);
  for (auto& [group, account] : accounts_) {
    if (account.taken != 0) tell(group, account);
  }
}

void CreditBook::open(GroupId group, std::uint32_t window, std::uint8_t number) {
  if (window == 0) return forget(group);
  plain_.fill(0);
  const MutexLock lock(mutex_);
  const auto [place, fresh] = accounts_.try_emplace(group.value());
  Account& account = place->second;
  account.window = window;
  if (!fresh && account.number == number) return;
  account.number = number;
  restart(account);
}

void CreditBook::forget(GroupId group) {
  const MutexLock lock(mutex_);
  accounts_.erase(group.value());
}

std::uint32_t CreditBook::epoch_for(std::uint32_t group) {
  std::uint32_t& plain = plain_[group % kPlainSlots];
  if (plain == group) return 0;  // also for 0, which no group has
  const MutexLock lock(mutex_);
  const auto found = accounts_.find(group);
  if (found != accounts_.end()) return found->second.epoch;
  plain = group;
  return 0;
}

void CreditBook::take(std::uint32_t group, std::uint32_t epoch, std::uint32_t messages, bool more) {
  if (epoch == 0) return;
  const MutexLock lock(mutex_);
  const auto found = accounts_.find(group);
  if (found == accounts_.end() || epoch != found->second.epoch) return;
  Account& account = found->second;
  account.taken += messages;
  const std::uint64_t enough = more ? std::max(1u, account.window / 2) : 1;
  if (account.taken - account.told >= enough) tell(group, account);
}

bool CreditBook::tell_missed(GroupId group, std::uint64_t total) {
  const MutexLock lock(mutex_);
  return takes_missed_ && outbound_.post(proto::flow::Missed{group, total});
}

void CreditBook::restart(Account& account) {
  account.epoch = ++epochs_;
  account.taken = account.told = 0;
}

void CreditBook::tell(std::uint32_t group, Account& account) {
  // Not connected: the next WELCOME brings it.
  if (outbound_.post(proto::flow::Credit{GroupId{group}, account.taken, account.number}))
    account.told = account.taken;
}

}  // namespace gimnet::nif
