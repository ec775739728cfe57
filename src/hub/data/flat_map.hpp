#pragma once

#include <boost/container_hash/hash.hpp>
#include <boost/version.hpp>

// The fastest hash map of the installed Boost. boost::unordered_flat_map keeps its memory when it
// is cleared; with Boost before 1.81 std::unordered_map takes its place, which allocates for each
// key (ADR 0013).

#if BOOST_VERSION >= 108100
#include <boost/unordered/unordered_flat_map.hpp>

namespace gimnet::hub {
template <class Key, class Value>
using FlatMap = boost::unordered_flat_map<Key, Value>;
}  // namespace gimnet::hub
#else
#include <unordered_map>

namespace gimnet::hub {
template <class Key, class Value>
using FlatMap = std::unordered_map<Key, Value, boost::hash<Key> >;
}  // namespace gimnet::hub
#endif
