#include "hub/control/state/index_set.hpp"

#include <algorithm>
#include <bit>

namespace gimnet::hub {

void IndexSet::insert(std::uint32_t index) {
  if (contains(index)) return;
  if (index / 8 >= bytes_.size()) bytes_.resize(index / 8 + 1);
  bytes_[index / 8] |= bit(index);
  ++size_;
}

void IndexSet::erase(std::uint32_t index) {
  if (!contains(index)) return;
  bytes_[index / 8] &= ~bit(index);
  --size_;
}

std::span<const std::byte> IndexSet::bytes() const {
  std::size_t size = bytes_.size();
  while (size > 0 && bytes_[size - 1] == std::byte{0}) --size;
  return std::span{bytes_}.first(size);
}

std::optional<IndexSet> IndexSet::from_bytes(std::span<const std::byte> bytes, std::uint32_t most) {
  if (bytes.empty()) return IndexSet{};
  if (bytes.size() > bytes_max(most)) return std::nullopt;
  const auto last = std::to_integer<unsigned>(bytes.back());
  if (last == 0 || (bytes.front() & bit(0)) != std::byte{0}) return std::nullopt;
  const std::size_t highest =
      8 * (bytes.size() - 1) + static_cast<std::size_t>(std::bit_width(last)) - 1;
  if (highest > most) return std::nullopt;
  IndexSet set;
  set.bytes_.assign(bytes.begin(), bytes.end());
  for (const std::byte each : bytes) {
    set.size_ += static_cast<std::uint32_t>(std::popcount(std::to_integer<unsigned>(each)));
  }
  return set;
}

bool operator==(const IndexSet& a, const IndexSet& b) {
  return std::ranges::equal(a.bytes(), b.bytes());
}

}  // namespace gimnet::hub
