#include "client/nif/last_messages.hpp"

#include <new>

namespace gimnet::nif {
namespace {

/// So much memory a service keeps for its next message, however small the last one is.
constexpr std::size_t kRoomKept = 64 * 1024;

}  // namespace

proto::FrameParts LastMessage::parts() const {
  proto::FrameParts parts;
  parts.header = header;
  parts.key = key;
  parts.extensions = extensions;
  return parts;
}

void LastMessages::follow(const std::string& service, std::uint32_t group) {
  Entry& entry = by_service_[service];
  leave_group(entry);
  entry.group = group;
  entry.last.header.dst = group;
  if (group != 0) by_group_[group] = &entry;
}

void LastMessages::forget(const std::string& service) {
  const auto found = by_service_.find(service);
  if (found == by_service_.end()) return;
  clear(found->second);
  leave_group(found->second);
  by_service_.erase(found);
}

/// Another service may have the group by now.
void LastMessages::leave_group(const Entry& entry) {
  const auto found = by_group_.find(entry.group);
  if (found != by_group_.end() && found->second == &entry) by_group_.erase(found);
}

/// Gives the memory back, too.
void LastMessages::clear(Entry& entry) {
  bytes_ -= entry.last.payload.capacity();
  entry.last.payload = std::vector<std::byte>();
  entry.there = false;
}

void LastMessages::keep(Outgoing& message) {
  const auto found = by_group_.find(message.parts().header.dst);
  if (found == by_group_.end() || keep(*found->second, message)) return;
  clear(*found->second);
  ++not_kept_;
}

bool LastMessages::keep(Entry& entry, Outgoing& message) {
  const proto::FrameParts& parts = message.parts();
  LastMessage& last = entry.last;
  const std::size_t size = message.size();
  const std::size_t room = last.payload.capacity();
  if (size > room || (room > kRoomKept && size < room / 4)) clear(entry);
  const std::size_t data = message.application_bytes();
  if (data > message_bytes_max_ || bytes_ - last.payload.capacity() + data > kBytesMax)
    return false;
  try {
    last.extensions.assign(parts.extensions.begin(), parts.extensions.end());
    const std::size_t before = last.payload.capacity();
    last.payload.resize(size);
    bytes_ += last.payload.capacity() - before;
  } catch (const std::bad_alloc&) {
    return false;  // the message itself is on its way
  }
  message.copy_to(last.payload);
  last.header = parts.header;
  last.key = parts.key;
  entry.there = true;
  return true;
}

const LastMessage* LastMessages::find(const std::string& service) const {
  const auto found = by_service_.find(service);
  if (found == by_service_.end() || found->second.group == 0 || !found->second.there)
    return nullptr;
  return &found->second.last;
}

}  // namespace gimnet::nif
