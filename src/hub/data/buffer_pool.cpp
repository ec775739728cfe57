#include "hub/data/buffer_pool.hpp"

#include <algorithm>
#include <new>

#include "base/check.hpp"

namespace gimnet::hub {
namespace {
constexpr std::size_t kAlignment = 64;
constexpr std::size_t kHeaderRoom = 16;  // a frame's header, which its length does not count
constexpr std::size_t kFreeForeignMax = 4096;
/// For a smaller chunk, looking through what is lent would cost more than a new one.
constexpr std::uint32_t kTakeBackBytes = kSharedChunkBytes;
}  // namespace

void BufferRef::recycle(Buffer& buffer) { buffer.pool->recycle(buffer); }

void BufferPool::FreeList::push(Buffer& buffer) {
  buffer.next_free = head;
  head = &buffer;
  ++count;
}

Buffer* BufferPool::FreeList::pop() {
  Buffer* buffer = head;
  if (buffer != nullptr) {
    head = buffer->next_free;
    --count;
  }
  return buffer;
}

BufferPool::BufferPool(std::uint32_t frame_bytes, BudgetLease& budget)
    : slab_bytes_(static_cast<std::uint32_t>(kSlabReadBytes + kHeaderRoom + frame_bytes)),
      chunk_bytes_{256 - kBufferRoom, 1024 - kBufferRoom, 4 * 1024 - kBufferRoom, kSharedChunkBytes,
                   static_cast<std::uint32_t>(kHeaderRoom + frame_bytes)},
      budget_(budget) {}

BufferPool::~BufferPool() {
  while (Buffer* slab = free_slabs_.pop()) free_buffer(slab);
  while (Buffer* foreign = free_foreign_.pop()) free_buffer(foreign);
  for (FreeList& list : free_chunks_) {
    while (Buffer* chunk = list.pop()) free_buffer(chunk);
  }
  // acquire pairs with the release in end_loan(); shards are joined before their pools go, so no
  // loan is open.
  for (Buffer* buffer : lent_) {
    GIMNET_CHECK(buffer->lent.load(std::memory_order_acquire) == 0);
    free_buffer(buffer);
  }
}

BufferRef BufferPool::take_slab() {
  if (free_slabs_.head == nullptr) take_back_lent();
  Buffer* slab = free_slabs_.pop();
  if (slab == nullptr) slab = allocate(slab_bytes_, BufferKind::slab);
  return BufferRef(slab);
}

BufferRef BufferPool::take_chunk(std::uint32_t bytes) {
  for (std::size_t size_class = 0; size_class < chunk_bytes_.size(); ++size_class) {
    if (bytes > chunk_bytes_[size_class]) continue;
    Buffer* chunk = free_chunks_[size_class].pop();
    if (chunk == nullptr && !lent_.empty() && chunk_bytes_[size_class] >= kTakeBackBytes) {
      take_back_lent();
      chunk = free_chunks_[size_class].pop();
    }
    if (chunk == nullptr) {
      chunk = allocate(chunk_bytes_[size_class], BufferKind::chunk);
      chunk->size_class = static_cast<std::uint8_t>(size_class);
    }
    return BufferRef(chunk);
  }
  return take_exact(bytes);
}

BufferRef BufferPool::take_exact(std::uint32_t bytes) {
  Buffer* chunk = allocate(bytes, BufferKind::chunk);
  chunk->size_class = kUnpooled;
  return BufferRef(chunk);
}

Buffer* BufferPool::lend(Buffer& buffer) {
  Buffer* owner = buffer.kind == BufferKind::foreign ? buffer.lender : &buffer;
  // relaxed: the entry itself is published by the mailbox; the count only has to be there before
  // the lender lets go, and the lender is this thread or holds a loan that this thread keeps open.
  owner->lent.fetch_add(1, std::memory_order_relaxed);
  return owner;
}

BufferRef BufferPool::adopt(Buffer* lent) {
  const auto known = std::find_if(adopted_.begin(), adopted_.end(), [&](const Buffer* each) {
    return each->lender->pool == lent->pool;
  });
  if (known != adopted_.end() && (*known)->lender == lent) {
    end_loan(lent);  // one loan is enough
    return BufferRef(*known);
  }
  Buffer* foreign = free_foreign_.pop();
  if (foreign == nullptr) {
    foreign = new Buffer;
    foreign->kind = BufferKind::foreign;
    foreign->pool = this;
  }
  foreign->lender = lent;
  foreign->data = lent->data;
  foreign->capacity = lent->capacity;
  if (known != adopted_.end()) {
    *known = foreign;
  } else {
    adopted_.push_back(foreign);
  }
  return BufferRef(foreign);
}

void BufferPool::end_loan(Buffer* lent) {
  lent->lent.fetch_sub(
      1, std::memory_order_release);  // pairs with the acquire loads in recycle(), take_back_lent()
}

void BufferPool::pin(Buffer& buffer, BudgetLease& payer) {
  if (buffer.payer != nullptr) return;
  buffer.payer = &payer;
  pinned_bytes_ += kBufferRoom + buffer.capacity;
  payer.take(kBufferRoom + buffer.capacity);
}

void BufferPool::unpin(Buffer& buffer) {
  if (buffer.payer == nullptr) return;
  pinned_bytes_ -= kBufferRoom + buffer.capacity;
  std::exchange(buffer.payer, nullptr)->give_back(kBufferRoom + buffer.capacity);
}

void BufferPool::recycle(Buffer& buffer) {
  unpin(buffer);
  switch (buffer.kind) {
    case BufferKind::foreign:
      std::erase(adopted_, &buffer);
      end_loan(std::exchange(buffer.lender, nullptr));
      if (free_foreign_.count < kFreeForeignMax) return free_foreign_.push(buffer);
      break;
    case BufferKind::slab:
    case BufferKind::chunk:
      // acquire pairs with the release in end_loan(): the other shard has read its last byte.
      if (buffer.lent.load(std::memory_order_acquire) != 0) return lent_.push_back(&buffer);
      return keep_or_free(buffer);
  }
  free_buffer(&buffer);
}

void BufferPool::keep_or_free(Buffer& buffer) {
  if (buffer.kind == BufferKind::slab) {
    if (free_slabs_.count < free_slabs_max()) return free_slabs_.push(buffer);
  } else if (buffer.size_class != kUnpooled) {
    FreeList& list = free_chunks_[buffer.size_class];
    if (list.count * buffer.capacity < free_chunk_bytes_max()) return list.push(buffer);
  }
  free_buffer(&buffer);
}

std::size_t BufferPool::kept_chunk_bytes() const {
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < free_chunks_.size(); ++i)
    bytes += free_chunks_[i].count * chunk_bytes_[i];
  return bytes;
}

void BufferPool::free_kept() {
  while (free_slabs_.count > free_slabs_max()) free_buffer(free_slabs_.pop());
  for (std::size_t i = 0; i < free_chunks_.size(); ++i) {
    FreeList& list = free_chunks_[i];
    while (list.count * chunk_bytes_[i] > free_chunk_bytes_max()) free_buffer(list.pop());
  }
}

void BufferPool::take_back_lent() {
  for (std::size_t i = 0; i < lent_.size();) {
    Buffer* buffer = lent_[i];
    // acquire: pairs with the release in end_loan()
    if (buffer->lent.load(std::memory_order_acquire) != 0) {
      ++i;
      continue;
    }
    lent_[i] = lent_.back();
    lent_.pop_back();
    keep_or_free(*buffer);
  }
}

Buffer* BufferPool::allocate(std::uint32_t capacity, BufferKind kind) {
  // One piece of memory, so that a small chunk is two neighbouring cache lines and not two
  // somewhere.
  void* memory = ::operator new(kBufferRoom + capacity, std::align_val_t{kAlignment});
  auto* buffer = new (memory) Buffer;
  buffer->data = static_cast<std::byte*>(memory) + kBufferRoom;
  buffer->capacity = capacity;
  buffer->kind = kind;
  buffer->pool = this;
  return buffer;
}

void BufferPool::free_buffer(Buffer* buffer) {
  if (buffer->kind == BufferKind::foreign) {
    delete buffer;
    return;
  }
  buffer->~Buffer();
  ::operator delete(buffer, std::align_val_t{kAlignment});
}

}  // namespace gimnet::hub
