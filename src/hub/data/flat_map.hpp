#pragma once

#include <boost/version.hpp>
#include <cstddef>
#include <cstdint>

#if BOOST_VERSION >= 108100
#include <boost/unordered/unordered_flat_map.hpp>
#else
#include <unordered_map>
#endif

// The fastest hash map of the installed Boost. boost::unordered_flat_map keeps its memory when it
// is cleared; with Boost before 1.81 std::unordered_map takes its place, which allocates for each
// key (ADR 0013).

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
template <class Key, class Value>
using FlatMap = std::unordered_map<Key, Value, FlatHash>;
#endif

}  // namespace gimnet::hub
