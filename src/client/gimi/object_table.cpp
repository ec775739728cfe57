#include "client/gimi/object_table.hpp"

#include <array>
#include <atomic>
#include <new>

#include "client/nif/platform.hpp"

namespace gimnet::gimi {
namespace {

// A slot's state: generation in the upper half; in the lower one a bit for "open" and the number of
// calls inside.
constexpr std::uint64_t kOpen = 0x8000'0000u;
constexpr std::uint64_t kUsersMask = 0x7FFF'FFFFu;

struct Slot {
  std::atomic<std::uint64_t> state{0};
  // Written by who claims the slot, before `open` is set.
  std::unique_ptr<Object> object;
  HandleKind kind{};
  std::uint32_t fork_generation = 0;
  std::atomic<std::uint32_t> next_free{0};  ///< slot + 1; 0: none
};

// Slots come in blocks, which stay. No lock anywhere: it would stay locked in the child of a fork()
// for ever.
constexpr std::uint32_t kBlockSlots = 1024;
struct Block {
  std::array<Slot, kBlockSlots> slots;
};
constinit std::array<std::atomic<Block*>, kHandlesMax / kBlockSlots> g_blocks{};
constinit std::atomic<std::uint32_t> g_used{0};  ///< slots that were ever claimed
/// Slots that were given back, the youngest first: slot + 1 in the lower half; above it a count, so
/// that a slot which left and came back meanwhile is told from one that stayed.
constinit std::atomic<std::uint64_t> g_free{0};

constexpr unsigned kKindShift = 24;
constexpr std::uint32_t kSlotMask = (1u << kKindShift) - 1;

gimi_handle handle_of(HandleKind kind, std::uint32_t slot, std::uint64_t state) {
  return (state & ~std::uint64_t{UINT32_MAX}) |
         (std::uint32_t{static_cast<std::uint8_t>(kind)} << kKindShift) | slot;
}
std::uint32_t slot_of(gimi_handle handle) { return static_cast<std::uint32_t>(handle) & kSlotMask; }
HandleKind kind_of(gimi_handle handle) {
  return static_cast<HandleKind>((static_cast<std::uint32_t>(handle) >> kKindShift) & 0xFF);
}
std::uint32_t generation_of(std::uint64_t state_or_handle) {
  return static_cast<std::uint32_t>(state_or_handle >> 32);
}

/// Null: no handle ever had that slot.
Slot* find_slot(std::uint32_t index) {
  if (index >= kHandlesMax) return nullptr;
  Block* const block = g_blocks[index / kBlockSlots].load();
  return block == nullptr ? nullptr : &block->slots[index % kBlockSlots];
}

/// The slot of an open handle with one more user; null: there is no such handle. In a child the
/// users of the parent's threads stay.
Slot* enter(gimi_handle handle) {
  Slot* const slot = find_slot(slot_of(handle));
  if (slot == nullptr) return nullptr;
  std::uint64_t state = slot->state.load();
  do {
    if ((state & kOpen) == 0 || generation_of(state) != generation_of(handle)) return nullptr;
  } while (!slot->state.compare_exchange_weak(state, state + 1));
  return slot;
}

void free_slot(std::uint32_t index) {
  Slot& slot = *find_slot(index);
  std::uint64_t head = g_free.load();
  do {
    slot.next_free.store(static_cast<std::uint32_t>(head));
  } while (
      !g_free.compare_exchange_weak(head, (((head >> 32) + 1) << 32) | (std::uint64_t{index} + 1)));
}

void leave_slot(std::uint32_t index) {
  Slot& slot = *find_slot(index);
  if (((slot.state.fetch_sub(1) - 1) & (kOpen | kUsersMask)) != 0) return;
  slot.object.reset();
  free_slot(index);
}

/// A slot that nobody has; kHandlesMax: there is none.
std::uint32_t claim_slot() {
  std::uint64_t head = g_free.load();
  while (static_cast<std::uint32_t>(head) != 0) {
    const std::uint32_t index = static_cast<std::uint32_t>(head) - 1;
    const std::uint64_t next = find_slot(index)->next_free.load();
    if (g_free.compare_exchange_weak(head, (((head >> 32) + 1) << 32) | next)) return index;
  }
  std::uint32_t used = g_used.load();
  do {
    if (used == kHandlesMax) return kHandlesMax;
    std::atomic<Block*>& block = g_blocks[used / kBlockSlots];
    if (block.load() != nullptr) continue;
    std::unique_ptr<Block> made(new (std::nothrow) Block);
    if (made == nullptr) return kHandlesMax;
    Block* none = nullptr;
    if (block.compare_exchange_strong(none, made.get())) static_cast<void>(made.release());
  } while (!g_used.compare_exchange_weak(used, used + 1));
  return used;
}

}  // namespace

void ObjectRef::leave() const { leave_slot(slot_); }

ObjectRef find_object(gimi_handle handle) {
  ObjectRef ref;
  const Slot* const slot = enter(handle);
  if (slot == nullptr) return ref;
  ref.slot_ = slot_of(handle);
  ref.kind_ = slot->kind;
  if (slot->fork_generation != nif::fork_generation()) {
    ref.status_ = GIMI_FORKED;
    leave_slot(ref.slot_);
  } else if (slot->kind != kind_of(handle)) {
    leave_slot(ref.slot_);
  } else {
    ref.object_ = slot->object.get();
    ref.status_ = GIMI_OK;
  }
  return ref;
}

gimi_status no_object(const ObjectRef& ref) {
  if (ref.status() == GIMI_FORKED) {
    return fail(GIMI_FORKED,
                "the node belongs to the parent process: after fork(), join anew in the child");
  }
  if (ref.object() != nullptr)
    return fail(GIMI_BAD_ARGUMENT, "the handle is of another kind than this call takes");
  return fail(GIMI_CLOSED, "no such handle: it was closed, or never came from this library");
}

gimi_handle add_object(HandleKind kind, std::unique_ptr<Object> object) {
  const std::uint32_t index = claim_slot();
  if (index == kHandlesMax) return 0;
  Slot& slot = *find_slot(index);
  slot.object = std::move(object);
  slot.kind = kind;
  slot.fork_generation = nif::fork_generation();
  const std::uint64_t next = ((slot.state.load() >> 32) + 1) << 32;
  slot.state.store(next | kOpen);
  return handle_of(kind, index, next);
}

gimi_status close_object(gimi_handle handle) {
  Slot* const slot = enter(handle);
  if (slot == nullptr) return GIMI_CLOSED;
  const std::uint32_t index = slot_of(handle);
  std::uint64_t state = slot->state.load();
  bool closes = slot->kind == kind_of(handle);
  do {
    closes = closes && (state & kOpen) != 0;
  } while (closes && !slot->state.compare_exchange_weak(state, state & ~kOpen));
  if (closes && slot->fork_generation != nif::fork_generation()) {
    slot->object->abandon();
    return GIMI_OK;  // the slot stays: whoever was inside at the fork never leaves it
  }
  if (closes) {
    Object* const object = slot->object.get();
    static_cast<void>(
        object->visit_source([object](WaitSource& source, bool) { source.leave(object); }));
    object->end();
  }
  leave_slot(index);
  return closes ? GIMI_OK : GIMI_CLOSED;
}

}  // namespace gimnet::gimi
