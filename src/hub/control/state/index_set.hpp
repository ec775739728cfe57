#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace gimnet::hub {

/// A set of indices of nodes or groups. A value type. Limits: one bit for each index up to the
/// highest so far.
class IndexSet {
 public:
  [[nodiscard]] bool contains(std::uint32_t index) const {
    return index / 8 < bytes_.size() && (bytes_[index / 8] & bit(index)) != std::byte{0};
  }
  void insert(std::uint32_t index);
  void erase(std::uint32_t index);
  [[nodiscard]] std::uint32_t size() const { return size_; }

  /// Index i is bit i % 8 of byte i / 8, and the last byte is not 0. Valid until: the set changes.
  [[nodiscard]] std::span<const std::byte> bytes() const;
  /// Reads what bytes() gave, of indices from 1 to `most`; nothing for any other bytes.
  [[nodiscard]] static std::optional<IndexSet> from_bytes(std::span<const std::byte> bytes,
                                                          std::uint32_t most);
  /// The longest that bytes() can be for indices up to `most`.
  [[nodiscard]] static constexpr std::size_t bytes_max(std::uint32_t most) { return most / 8 + 1; }

  friend bool operator==(const IndexSet& a, const IndexSet& b);

 private:
  [[nodiscard]] static constexpr std::byte bit(std::uint32_t index) {
    return std::byte{1} << (index % 8);
  }

  std::vector<std::byte> bytes_;
  std::uint32_t size_ = 0;
};

}  // namespace gimnet::hub
