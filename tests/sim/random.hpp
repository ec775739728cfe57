#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>

#include "base/check.hpp"

namespace gimnet::sim {

/// xoshiro256**, seeded by splitmix64 (Blackman and Vigna, https://prng.di.unimi.it). The
/// distributions of the standard library are not used: they differ between libraries. Two draws
/// never stand in one expression of which the order of evaluation is open. Thread safety: none.
///
/// A fuzzer may give `choices`: they are taken first, as few bytes for each draw as its bound
/// needs, so that changing one byte changes one draw. Valid until: the generator ends.
class Random {
 public:
  explicit Random(std::uint64_t seed, std::span<const std::uint8_t> choices = {})
      : choices_(choices) {
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
    return (choices_.empty() ? next() : chosen(bound)) % bound;
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
  std::uint64_t chosen(std::uint64_t bound) {
    std::uint64_t value = 0;
    for (int shift = 0; shift < 64 && (bound - 1) >> shift != 0 && !choices_.empty(); shift += 8) {
      value |= std::uint64_t{choices_.front()} << shift;
      choices_ = choices_.subspan(1);
    }
    return value;
  }

  std::array<std::uint64_t, 4> state_{};
  std::span<const std::uint8_t> choices_;
};

}  // namespace gimnet::sim
