#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "hub/control/state/session_token.hpp"

namespace gimnet::hub {

/// For each node index the least session number whose token may still claim it: lower ones are of
/// sessions that left, or after which somebody else had the index. Thread safety: none. Limits: 8
/// bytes an index, in pages of 4,096, of which there are only those that were written.
class NumberFloor {
 public:
  /// 0 where nothing was raised.
  [[nodiscard]] SessionNumber at(NodeIndex index) const;
  /// From now on tokens below `number` do not claim the index. Never lowers.
  void raise(NodeIndex index, SessionNumber number);

 private:
  static constexpr std::uint32_t kPage = 4'096;
  using Page = std::array<SessionNumber, kPage>;
  std::vector<std::unique_ptr<Page>> pages_;
};

}  // namespace gimnet::hub
