#pragma once

#include <cstddef>
#include <vector>

#include "hub/limits.hpp"

namespace gimnet::hub {

/// Descriptors that are kept open for nothing: given up one by one when there are no others and an
/// administrator has to get in, and taken back, before anybody else gets them, when some are free
/// again. Thread safety: none. Ownership: of what it keeps. Limits: limits.administrators.
class DescriptorReserve {
 public:
  /// REQUIRES: limits outlives it.
  explicit DescriptorReserve(const Limits& limits);
  ~DescriptorReserve();
  DescriptorReserve(const DescriptorReserve&) = delete;
  DescriptorReserve& operator=(const DescriptorReserve&) = delete;

  /// Keeps as many as the limit says, as far as there are.
  void fill();
  /// One more descriptor is free. False: none is kept any more.
  [[nodiscard]] bool give_up_one();
  [[nodiscard]] std::size_t kept() const { return kept_.size(); }

 private:
  const Limits& limits_;
  std::vector<int> kept_;
};

/// A descriptor of no use, or -1 if there is none to be had.
[[nodiscard]] int open_spare_descriptor();

}  // namespace gimnet::hub
