#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "base/check.hpp"

namespace gimnet::sim {

/// xoshiro256**, seeded by splitmix64 (Blackman and Vigna, https://prng.di.unimi.it). The
/// distributions of the standard library are not used: they differ between libraries. Two draws
/// never stand in one expression of which the order of evaluation is open. Thread safety: none.
class Random {
 public:
  explicit Random(std::uint64_t seed) {
    for (std::uint64_t& word : state_) {
      seed += 0x9E3779B97F4A7C15u;
      std::uint64_t z = seed;
      z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
      z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
      word = z ^ (z >> 31);
    }
  }

  std::uint64_t next() {
    const std::uint64_t result = std::rotl(state_[1] * 5, 7) * 9;
    const std::uint64_t t = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= t;
    state_[3] = std::rotl(state_[3], 45);
    return result;
  }
  /// 0..bound-1. The bias of the remainder does not matter here.
  std::uint64_t below(std::uint64_t bound) {
    GIMNET_CHECK(bound > 0);
    return next() % bound;
  }
  /// least..most, both included.
  std::uint64_t between(std::uint64_t least, std::uint64_t most) {
    return least + below(most - least + 1);
  }
  bool chance(std::uint64_t per_thousand) { return below(1'000) < per_thousand; }
  /// REQUIRES: not empty; random access.
  template <class List>
  auto& pick(List& list) {
    return list[static_cast<std::size_t>(below(list.size()))];
  }

 private:
  std::array<std::uint64_t, 4> state_{};
};

}  // namespace gimnet::sim
