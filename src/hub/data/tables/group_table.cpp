#include "hub/data/tables/group_table.hpp"

#include <sys/mman.h>

#include <new>

#include "base/check.hpp"

namespace gimnet::hub {
namespace {
constexpr std::size_t kEntries = std::size_t{1} << kIndexBits;
constexpr std::size_t kBytes = kEntries * sizeof(std::atomic<const GroupMembers*>);
static_assert(std::atomic<const GroupMembers*>::is_always_lock_free);

/// In memory that the kernel hands out page by page.
std::atomic<const GroupMembers*>* map_entries() {
  void* memory = ::mmap(nullptr, kBytes, PROT_READ | PROT_WRITE,
                        MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc{};
  return static_cast<std::atomic<const GroupMembers*>*>(memory);
}

}  // namespace

GroupTable::GroupTable() : members_(map_entries()) {}

GroupTable::~GroupTable() {
  ::munmap(static_cast<void*>(members_), kBytes);
  for (const auto& each : away_) {
    // relaxed: whoever destroys it is alone with it
    if (Entry* entries = each.load(std::memory_order_relaxed))
      ::munmap(static_cast<void*>(entries), kBytes);
  }
}

const GroupMembers* GroupTable::exchange(std::uint32_t index, const GroupMembers* members) {
  GIMNET_CHECK(index < kEntries);
  // release pairs with the acquire load in find(); acquire because the old members are freed by
  // this thread.
  return members_[index].exchange(members, std::memory_order_acq_rel);
}

const GroupMembers* GroupTable::exchange_away(GroupId group, const GroupMembers* members) {
  std::atomic<Entry*>& place = away_.at(hub_of(group).value());
  Entry* entries = place.load(std::memory_order_relaxed);  // this thread wrote it
  if (entries == nullptr) {
    entries = map_entries();
    place.store(entries, std::memory_order_release);  // pairs with the acquire in find_away()
  }
  // As in exchange().
  return entries[index_of(group)].exchange(members, std::memory_order_acq_rel);
}

}  // namespace gimnet::hub
