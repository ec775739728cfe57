#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <new>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/check.hpp"
#include "base/ids.hpp"

namespace gimnet::hub {

/// The members of a group on one shard, each once, in the order of their slots. A copy shares with
/// the list that it was made from all that neither of them changes afterwards: it costs a pointer
/// for each chunk of members, and a change no more than one chunk, however long the list is
/// (docs/adr/0008-lists-of-members-share.md).
///
/// Thread safety: one thread makes, copies, changes and destroys all lists that share. Any other
/// may look at a list meanwhile that is not changed any more: what it reads is never written, since
/// a chunk that two lists have is changed by neither. Ownership: of its part in the chunks.
/// REQUIRES of Member: trivial to copy, with a ConnectionSlot `slot`.
template <class Member>
class MemberList {
 public:
  /// A change copies at most this many members. The larger it is, the fewer pointers a copy of the
  /// list takes.
  static constexpr std::size_t kChunkMembers = 256;

  MemberList() = default;
  MemberList(std::initializer_list<Member> members) {
    for (const Member& member : members) put(member);
  }
  MemberList(const MemberList& other) : chunks_(other.chunks_), size_(other.size_) {
    for (Chunk* chunk : chunks_) ++chunk->lists;
  }
  MemberList(MemberList&& other) noexcept { swap(other); }
  MemberList& operator=(MemberList other) noexcept {
    swap(other);
    return *this;
  }
  ~MemberList() {
    for (Chunk* chunk : chunks_) Chunk::release(chunk);
  }

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] bool empty() const { return size_ == 0; }
  [[nodiscard]] std::size_t chunks() const { return chunks_.size(); }

  /// Calls take(const Member&) for each.
  template <class Take>
  void for_each(Take&& take) const {
    for (const Chunk* chunk : chunks_) {
      const Member* const end = chunk->end();
      for (const Member* member = chunk->begin(); member != end; ++member) take(*member);
    }
  }

  /// nullptr: no member has that slot. Valid until: the list is changed.
  [[nodiscard]] const Member* find(ConnectionSlot slot) const {
    const std::size_t at = chunk_of(slot);
    if (at == chunks_.size()) return nullptr;
    const Member* const found = chunks_[at]->place_of(slot);
    return found->slot == slot ? found : nullptr;
  }

  /// Adds the member, or puts it in the place of the one that has its slot.
  void put(const Member& member) {
    if (chunks_.empty()) {
      chunks_.push_back(Chunk::make(1));
      chunks_[0]->insert(0, member);
      size_ = 1;
      return;
    }
    const std::size_t at = std::min(chunk_of(member.slot), chunks_.size() - 1);
    const Member* const found = chunks_[at]->place_of(member.slot);
    const auto place = static_cast<std::size_t>(found - chunks_[at]->begin());
    if (found != chunks_[at]->end() && found->slot == member.slot) {
      own(at, chunks_[at]->count).begin()[place] = member;
      return;
    }
    ++size_;
    if (chunks_[at]->count < kChunkMembers)
      return own(at, chunks_[at]->count + 1).insert(place, member);
    split(at, place, member);
  }

  /// Returns whether there was one.
  bool erase(ConnectionSlot slot) {
    if (find(slot) == nullptr) return false;
    const std::size_t at = chunk_of(slot);
    const auto place = static_cast<std::size_t>(chunks_[at]->place_of(slot) - chunks_[at]->begin());
    --size_;
    Chunk& chunk = own(at, chunks_[at]->count);
    chunk.erase(place);
    if (chunk.count == 0) {
      drop(at);
    } else if (at + 1 < chunks_.size() &&
               chunk.count + chunks_[at + 1]->count <= kChunkMembers / 2) {
      join(at);
    } else if (at > 0 && chunk.count + chunks_[at - 1]->count <= kChunkMembers / 2) {
      join(at - 1);
    }
    return true;
  }

 private:
  static_assert(std::is_trivially_copyable_v<Member> && alignof(Member) <= alignof(std::uint32_t));

  /// Neighbours in the list, at least one. Its members lie right behind it, as many as it has room
  /// for: most groups are small.
  struct Chunk {
    std::uint32_t lists;  ///< that have it
    std::uint32_t count;
    std::uint32_t room;

    /// REQUIRES: least <= kChunkMembers.
    [[nodiscard]] static Chunk* make(std::size_t least) {
      const std::size_t room = std::bit_ceil(least);
      void* const memory = ::operator new(sizeof(Chunk) + room * sizeof(Member));
      return new (memory) Chunk{1, 0, static_cast<std::uint32_t>(room)};
    }
    static void release(Chunk* chunk) {
      if (--chunk->lists == 0) ::operator delete(chunk);
    }
    [[nodiscard]] Member* begin() { return reinterpret_cast<Member*>(this + 1); }
    [[nodiscard]] const Member* begin() const { return reinterpret_cast<const Member*>(this + 1); }
    [[nodiscard]] const Member* end() const { return begin() + count; }

    /// The first member whose slot is not below that one.
    [[nodiscard]] const Member* place_of(ConnectionSlot slot) const {
      return std::lower_bound(begin(), end(), slot,
                              [](const Member& member, ConnectionSlot wanted) {
                                return member.slot.value() < wanted.value();
                              });
    }
    void insert(std::size_t place, const Member& member) {
      GIMNET_ASSERT(lists == 1 && count < room);
      std::copy_backward(begin() + place, begin() + count, begin() + count + 1);
      begin()[place] = member;
      ++count;
    }
    void erase(std::size_t place) {
      GIMNET_ASSERT(lists == 1 && place < count);
      std::copy(begin() + place + 1, begin() + count, begin() + place);
      --count;
    }
    void append(const Chunk& other, std::size_t from) {
      GIMNET_ASSERT(lists == 1 && other.count - from <= room - count);
      std::copy(other.begin() + from, other.end(), begin() + count);
      count += other.count - static_cast<std::uint32_t>(from);
    }
  };

  void swap(MemberList& other) noexcept {
    std::swap(chunks_, other.chunks_);
    std::swap(size_, other.size_);
  }

  /// The chunk in which that slot is, if it is in one; as many as there are if it would stand
  /// behind all.
  [[nodiscard]] std::size_t chunk_of(ConnectionSlot slot) const {
    const auto found = std::lower_bound(chunks_.begin(), chunks_.end(), slot,
                                        [](const Chunk* chunk, ConnectionSlot wanted) {
                                          return (chunk->end() - 1)->slot.value() < wanted.value();
                                        });
    return static_cast<std::size_t>(found - chunks_.begin());
  }

  /// The chunk as this list's alone, with room for so many members.
  Chunk& own(std::size_t at, std::size_t room) {
    Chunk*& chunk = chunks_[at];
    if (chunk->lists > 1 || chunk->room < room) {
      Chunk* const copy = Chunk::make(room);
      copy->append(*chunk, 0);
      Chunk::release(std::exchange(chunk, copy));
    }
    return *chunk;
  }

  /// Puts the member into a full chunk at that place. Who comes last begins a chunk, so that those
  /// before stay full: slots are given out in this order.
  void split(std::size_t at, std::size_t place, const Member& member) {
    const bool is_last = at + 1 == chunks_.size() && place == kChunkMembers;
    const std::size_t from = is_last ? kChunkMembers : kChunkMembers / 2;
    Chunk* const upper = Chunk::make(kChunkMembers - from + 1);
    upper->append(*chunks_[at], from);
    chunks_.insert(chunks_.begin() + static_cast<std::ptrdiff_t>(at) + 1, upper);
    if (place >= from) {
      if (!is_last) own(at, kChunkMembers).count = static_cast<std::uint32_t>(from);
      return upper->insert(place - from, member);
    }
    Chunk& lower = own(at, kChunkMembers);
    lower.count = static_cast<std::uint32_t>(from);
    lower.insert(place, member);
  }

  /// The members of the next chunk go into this one.
  void join(std::size_t at) {
    const Chunk& next = *chunks_[at + 1];
    own(at, chunks_[at]->count + next.count).append(next, 0);
    drop(at + 1);
  }
  void drop(std::size_t at) {
    Chunk::release(chunks_[at]);
    chunks_.erase(chunks_.begin() + static_cast<std::ptrdiff_t>(at));
  }

  std::vector<Chunk*> chunks_;
  std::size_t size_ = 0;
};

}  // namespace gimnet::hub
