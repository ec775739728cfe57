#pragma once

#include <thread>

#include "base/check.hpp"

namespace gimnet {

/// Whose it is: what belongs to one thread says check_here() wherever it is entered. Debug builds
/// abort where another thread comes in; release builds check nothing. Thread safety: none, which is
/// what it finds out.
class OwnerThread {
 public:
  /// The first that comes is the owner.
  void check_here() const {
#ifndef NDEBUG
    const std::thread::id here = std::this_thread::get_id();
    if (owner_ == std::thread::id{}) owner_ = here;
    GIMNET_ASSERT(owner_ == here);
#endif
  }
  /// The owner has ended, or hands over: the next that comes is the owner. REQUIRES: no call at the
  /// same time.
  void let_go() {
#ifndef NDEBUG
    owner_ = std::thread::id{};
#endif
  }

#ifndef NDEBUG
 private:
  mutable std::thread::id owner_;
#endif
};

}  // namespace gimnet
