#include "client/gimi/accepted_service.hpp"

#include <algorithm>
#include <utility>

namespace gimnet::gimi {

OwnedServiceName AcceptedService::full_name() {
  const MutexLock lock(mutex_);
  full_name_->add_reference();
  return OwnedServiceName(full_name_.get());
}

Outcome<void> AcceptedService::standing() {
  const MutexLock lock(mutex_);
  if (end_) return end_.failure("accept " + full_name_->text);
  if (!refusal_) return {};
  std::string sentence = "cannot accept " + full_name_->text +
                         ": the hub did not take the service again, after a break or another name";
  if (!refusal_->sentence.empty()) sentence += ": " + refusal_->sentence;
  return Failure{refusal_->status, std::move(sentence)};
}

void AcceptedService::on_renamed(const std::string& own_name) {
  const MutexLock lock(mutex_);
  full_name_.reset(new ServiceName(own_name.empty() ? name_ : own_name + "/" + name_));
}

void AcceptedService::on_taken() {
  const MutexLock lock(mutex_);
  refusal_.reset();
}

void AcceptedService::on_refused(Failure refusal) {
  const MutexLock lock(mutex_);
  refusal_ = std::move(refusal);
}

void AcceptedService::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  end_ = ending;
}

AcceptedTable::Service AcceptedTable::add(const std::string& own_name, const std::string& name,
                                          const QueueOptions& options) {
  auto service = std::make_shared<AcceptedService>(inbox_, name, own_name, options);
  const MutexLock lock(mutex_);
  if (end_) service->end(end_);
  return services_.emplace_back(std::move(service));
}

void AcceptedTable::place(const Service& service, std::uint32_t group) {
  {
    const MutexLock lock(mutex_);
    service->asked = false;
    service->group = group;
    by_group_[group] = service;
  }
  uplink_.deliver();
}

void AcceptedTable::remove(const Service& service) {
  {
    const MutexLock lock(mutex_);
    std::erase(services_, service);
    if (service->group != 0) {
      forget_group(service);
      ended_groups_.push_back(service->group);
      if (ended_groups_.size() > kEndedGroupsMax) ended_groups_.pop_front();
    }
    if (!service->asked) return;
  }
  uplink_.deliver();
}

void AcceptedTable::forget_group(const Service& service) {
  const auto found = by_group_.find(service->group);
  if (found != by_group_.end() && found->second == service) by_group_.erase(found);
}

AcceptedTable::Found AcceptedTable::find(std::uint32_t group) {
  const MutexLock lock(mutex_);
  const auto found = by_group_.find(group);
  if (found != by_group_.end()) return {Place::found, found->second};
  if (std::ranges::any_of(services_, &AcceptedService::asked)) return {Place::not_yet, nullptr};
  const bool ended = std::ranges::find(ended_groups_, group) != ended_groups_.end();
  return {ended ? Place::unwanted : Place::unknown, nullptr};
}

AcceptedTable::Place AcceptedTable::on_own_service_moved(const std::string& name,
                                                         const ServiceTable::OwnMove& move) {
  const MutexLock lock(mutex_);
  bool asked = false;
  for (const Service& service : services_) {
    if (service->name() != name) continue;
    asked |= service->asked;
    if (service->asked || service->group != move.former) continue;
    forget_group(service);
    service->group = move.group;
    if (move.group != 0) by_group_[move.group] = service;
    service->on_taken();
    if (move.refusal) service->on_refused(*move.refusal);
    return Place::found;
  }
  return asked ? Place::not_yet : Place::unknown;
}

void AcceptedTable::on_renamed(const std::string& own_name) {
  const MutexLock lock(mutex_);
  for (const Service& service : services_) service->on_renamed(own_name);
}

void AcceptedTable::end(const Ending& ending) {
  const MutexLock lock(mutex_);
  end_ = ending;
  for (const Service& service : services_) service->end(ending);
}

}  // namespace gimnet::gimi
