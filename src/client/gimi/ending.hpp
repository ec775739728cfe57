#pragma once

#include <string>
#include <string_view>
#include <utility>

#include "gimnet/gimi/outcome.hpp"

namespace gimnet::gimi {

/// Why a node gives and takes nothing more: the program closed it, or no connection to the hub will
/// come any more. A value type; by itself: it goes on.
class Ending {
 public:
  Ending() = default;
  /// `why` as in "the node was closed". REQUIRES: not empty.
  Ending(Status status, std::string why) : status_(status), why_(std::move(why)) {}
  [[nodiscard]] static Ending closed() { return {Status::closed, "the node was closed"}; }

  [[nodiscard]] explicit operator bool() const { return !why_.empty(); }
  [[nodiscard]] const std::string& why() const { return why_; }
  /// What a call answers; `doing` as in "send to 7.17".
  [[nodiscard]] Failure failure(std::string_view doing) const {
    return {status_, "cannot " + std::string(doing) + ": " + why_};
  }

 private:
  Status status_ = Status::closed;
  std::string why_;
};

}  // namespace gimnet::gimi
