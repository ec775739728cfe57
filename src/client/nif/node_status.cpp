#include "client/nif/node_status.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

namespace gimnet::nif {
namespace {

void copy_text(char* to, std::size_t size, const std::string& text) {
  const std::size_t length = std::min(text.size(), size - 1);
  std::memcpy(to, text.data(), length);
  to[length] = '\0';
}

}  // namespace

nif_info NodeStatus::info() {
  const MutexLock lock(mutex_);
  return info_;
}

std::string NodeStatus::last_error() {
  const MutexLock lock(mutex_);
  return last_error_;
}

void NodeStatus::set_last_error(std::string sentence) {
  const MutexLock lock(mutex_);
  last_error_ = std::move(sentence);
}

void NodeStatus::add_counters(nif_counters& counters) {
  const MutexLock lock(mutex_);
  counters.frames_received = counts_.frames;
  counters.messages_received = counts_.messages;
  counters.messages_lost = counts_.messages_lost;
  counters.gaps = counts_.gaps;
  counters.frames_ignored = counts_.ignored;
  counters.frames_unreadable = counts_.unreadable;
  counters.bytes_received = bytes_received_;
  counters.read_calls = read_calls_;
}

void NodeStatus::connected(const SessionTerms& session, bool first) {
  const MutexLock lock(mutex_);
  info_.id = session.id;
  info_.hub_id = session.hub_id;
  info_.connected = 1;
  info_.resume = session.resume ? 1 : 0;
  info_.reconnects += first ? 0 : 1;
  info_.frame_bytes_max = session.frame_bytes_max;
  copy_text(info_.name, sizeof info_.name, session.name);
  copy_text(info_.hub_name, sizeof info_.hub_name, session.hub_name);
  if (!session.earlier_goodbye.empty())
    last_error_ = "the hub ended this node's last connection: " + session.earlier_goodbye;
}

void NodeStatus::disconnected(const std::string& why, bool for_good) {
  const MutexLock lock(mutex_);
  info_.connected = 0;
  info_.ended = for_good ? 1 : 0;
  last_error_ = why;
}

void NodeStatus::ended(bool replaced) {
  const MutexLock lock(mutex_);
  info_.token_kept = 0;
  info_.replaced = replaced ? 1 : 0;
  info_.ended = 1;
}

void NodeStatus::took_token(const TokenStore& tokens) {
  const MutexLock lock(mutex_);
  info_.token_kept = tokens.kept() ? 1 : 0;
  if (!tokens.fault().empty()) last_error_ = tokens.fault();
}

void NodeStatus::count_read(std::size_t bytes, const Inbound::Counts& counts) {
  const MutexLock lock(mutex_);
  bytes_received_ += bytes;
  ++read_calls_;
  counts_ = counts;
}

void NodeStatus::set_name(const std::string& name, std::vector<std::byte> token) {
  const MutexLock lock(mutex_);
  copy_text(info_.name, sizeof info_.name, name);
  info_.token_kept = 0;
  new_name_ = NewName{name, std::move(token)};
}

bool NodeStatus::is_own_service(const std::string& name) {
  const MutexLock lock(mutex_);
  const std::string own{info_.name};
  return !own.empty() && name.starts_with(own + '/');
}

std::optional<NodeStatus::NewName> NodeStatus::take_new_name() {
  const MutexLock lock(mutex_);
  return std::exchange(new_name_, std::nullopt);
}

}  // namespace gimnet::nif
