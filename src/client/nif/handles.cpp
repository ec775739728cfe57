#include "client/nif/handles.hpp"

#include <array>
#include <atomic>
#include <utility>

#include "client/nif/platform.hpp"

namespace gimnet::nif {
namespace {

// A slot's state: generation in the upper half; in the lower one a bit for "open" and the number of
// calls inside.
constexpr std::uint64_t kOpen = 0x8000'0000u;
constexpr std::uint64_t kUsersMask = 0x7FFF'FFFFu;

struct HandleSlot {
  std::atomic<std::uint64_t> state{0};
  std::atomic<Node*> node{
      nullptr};  ///< set by who claims the slot, before `open` is set; null: free
  std::uint32_t fork_generation = 0;  ///< written by the same, between the two
};

constinit std::array<HandleSlot, kHandlesMax> g_slots{};
constinit std::atomic<std::uint32_t> g_search_from{0};

// A handle, as the pointer that it looks like: generation, slot (12 bits), and 8 in the lowest 4
// bits, so that it is never null and never a pointer that malloc gives.
constexpr std::uintptr_t kTag = 8;
constexpr unsigned kSlotShift = 4;
constexpr unsigned kGenerationShift = 16;
constexpr std::uintptr_t kGenerationMask = UINTPTR_MAX >> kGenerationShift;

std::uintptr_t generation_of(std::uint64_t state) {
  return static_cast<std::uintptr_t>(state >> 32) & kGenerationMask;
}

nif_node* handle_of(std::uint32_t slot, std::uint64_t state) {
  const std::uintptr_t value =
      (generation_of(state) << kGenerationShift) | (std::uintptr_t{slot} << kSlotShift) | kTag;
  return reinterpret_cast<nif_node*>(
      value);  // NOLINT(performance-no-int-to-ptr): a number in a pointer's clothes
}

/// The slot that the handle names and, in the handle's own words, its generation. False: not a
/// handle.
bool take_apart(const nif_node* handle, std::uint32_t& slot, std::uintptr_t& generation) {
  const auto value = reinterpret_cast<std::uintptr_t>(handle);
  slot = static_cast<std::uint32_t>((value >> kSlotShift) & (kHandlesMax - 1));
  generation = value >> kGenerationShift;
  return (value & ((1u << kSlotShift) - 1)) == kTag;
}

nif_status no_handle() {
  return fail(NIF_CLOSED, "no such handle: it was closed, or never came from nif_connect()");
}
nif_status forked() {
  return fail(NIF_FORKED,
              "the handle belongs to the parent process: after fork(), connect anew in the child");
}

void leave(std::uint32_t slot) {
  if (((g_slots[slot].state.fetch_sub(1) - 1) & (kOpen | kUsersMask)) == 0)
    g_slots[slot].state.notify_all();
}

}  // namespace

NodeRef::NodeRef(NodeRef&& other) noexcept
    : node_(std::exchange(other.node_, nullptr)), slot_(other.slot_), status_(other.status_) {}

NodeRef::~NodeRef() {
  if (node_ != nullptr) leave(slot_);
}

NodeRef find_node(const nif_node* handle) {
  NodeRef ref;
  std::uintptr_t generation = 0;
  if (!take_apart(handle, ref.slot_, generation)) {
    ref.status_ = no_handle();
    return ref;
  }
  HandleSlot& slot = g_slots[ref.slot_];
  std::uint64_t state = slot.state.load();
  do {
    if ((state & kOpen) == 0 || generation_of(state) != generation) {
      ref.status_ = no_handle();
      return ref;
    }
  } while (!slot.state.compare_exchange_weak(state, state + 1));
  if (slot.fork_generation != fork_generation()) {
    leave(ref.slot_);
    ref.status_ = forked();
    return ref;
  }
  ref.node_ = slot.node;
  ref.status_ = NIF_OK;
  return ref;
}

// Claims by compare-and-swap: a lock would stay locked in the child of a fork() for ever.
nif_node* add_node(std::unique_ptr<Node>& node) {
  for (std::uint32_t i = 0; i < kHandlesMax; ++i) {
    // Slots rest as long as there are others, so that generations last.
    const std::uint32_t index = g_search_from.fetch_add(1) % kHandlesMax;
    HandleSlot& slot = g_slots[index];
    Node* claimed = nullptr;
    if (!slot.node.compare_exchange_strong(claimed, node.get())) continue;
    [[maybe_unused]] const Node* const owned = node.release();  // by the slot from now on
    slot.fork_generation = fork_generation();
    const std::uint64_t state = slot.state.load();
    const std::uint64_t next = (((state >> 32) + 1) << 32) | kOpen;
    slot.state.store(next);
    return handle_of(index, next);
  }
  return nullptr;
}

Node* share_node(const nif_node* handle) {
  const NodeRef ref = find_node(handle);
  if (!ref) return nullptr;
  ref->add_owner();
  return &*ref;
}

nif_status close_node(nif_node* handle) {
  std::uint32_t index = 0;
  {
    const NodeRef ref = find_node(handle);
    if (!ref && ref.status() != NIF_FORKED) return ref.status();
    if (ref && ref->thread().is_current())
      return fail(NIF_IN_CALLBACK, "nif_close() was called from the handle's own callback");
  }
  std::uintptr_t generation = 0;
  static_cast<void>(take_apart(handle, index, generation));
  HandleSlot& slot = g_slots[index];
  std::uint64_t state = slot.state.load();
  do {
    if ((state & kOpen) == 0 || generation_of(state) != generation) return no_handle();
  } while (!slot.state.compare_exchange_weak(state, state & ~kOpen));
  Node* const node = slot.node;
  if (slot.fork_generation != fork_generation()) {
    node->thread().abandon();
    return NIF_OK;
  }
  node->begin_close();
  for (state = slot.state.load(); (state & kUsersMask) != 0; state = slot.state.load())
    slot.state.wait(state);
  node->close();
  node->drop();
  slot.node = nullptr;
  return NIF_OK;
}

}  // namespace gimnet::nif
