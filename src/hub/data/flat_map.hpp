#pragma once

#include <boost/version.hpp>
#include <cstddef>
#include <cstdint>

#if BOOST_VERSION >= 108100
#include <boost/unordered/unordered_flat_map.hpp>
#else
#include <unordered_map>
#include <utility>
#include <vector>
#endif

// The fastest hash map of the installed Boost: boost::unordered_flat_map, which keeps its memory
// when it is cleared. With Boost before 1.81 a std::unordered_map that keeps its nodes takes its
// place (ADR 0013).

namespace gimnet::hub {

/// Hashes whole numbers to themselves and other keys by their hash_value(). boost::hash of Boost
/// 1.74 derives from a type that C++17 removed, and clang warns of it.
struct FlatHash {
  [[nodiscard]] std::size_t operator()(std::uint64_t key) const { return key; }
  template <class Key>
    requires requires(const Key& key) { hash_value(key); }
  [[nodiscard]] std::size_t operator()(const Key& key) const {
    return hash_value(key);
  }
};

#if BOOST_VERSION >= 108100
template <class Key, class Value>
using FlatMap = boost::unordered_flat_map<Key, Value, FlatHash>;
#else
/// std::unordered_map that keeps its nodes when it is cleared, so that one which grew allocates no
/// more. Thread safety: as its owner. Limit: as many nodes as it had keys at once.
template <class Key, class Value>
class FlatMap {
  using Map = std::unordered_map<Key, Value, FlatHash>;

 public:
  using value_type = typename Map::value_type;

  [[nodiscard]] auto find(const Key& key) { return map_.find(key); }
  [[nodiscard]] auto end() { return map_.end(); }
  [[nodiscard]] std::size_t size() const { return map_.size(); }
  [[nodiscard]] std::size_t bucket_count() const { return map_.bucket_count(); }
  Value& operator[](const Key& key) {
    if (spare_.empty()) return map_[key];
    if (const auto found = map_.find(key); found != map_.end()) return found->second;
    auto node = std::move(spare_.back());
    spare_.pop_back();
    node.key() = key;
    node.mapped() = Value{};
    return map_.insert(std::move(node)).position->second;
  }
  void clear() {
    spare_.reserve(spare_.size() + map_.size());
    while (!map_.empty()) spare_.push_back(map_.extract(map_.begin()));
  }

 private:
  Map map_;
  std::vector<typename Map::node_type> spare_;
};
#endif

}  // namespace gimnet::hub
