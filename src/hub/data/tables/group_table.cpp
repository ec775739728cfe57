#include "hub/data/tables/group_table.hpp"

#include <sys/mman.h>

#include <new>

#include "base/check.hpp"

namespace gimnet::hub {
namespace {
constexpr std::size_t kEntries = std::size_t{1} << kIndexBits;
constexpr std::size_t kBytes = kEntries * sizeof(std::atomic<const GroupMembers*>);
static_assert(std::atomic<const GroupMembers*>::is_always_lock_free);
}  // namespace

GroupTable::GroupTable() {
  void* memory = ::mmap(nullptr, kBytes, PROT_READ | PROT_WRITE,
                        MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc{};
  members_ = static_cast<std::atomic<const GroupMembers*>*>(memory);
}

GroupTable::~GroupTable() { ::munmap(static_cast<void*>(members_), kBytes); }

const GroupMembers* GroupTable::exchange(std::uint32_t index, const GroupMembers* members) {
  GIMNET_CHECK(index < kEntries);
  // release pairs with the acquire load in find(); acquire because the old members are freed by
  // this thread.
  return members_[index].exchange(members, std::memory_order_acq_rel);
}

}  // namespace gimnet::hub
