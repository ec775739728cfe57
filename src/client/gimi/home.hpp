#pragma once

#include <cstdint>
#include <type_traits>

#include "client/nif/platform.hpp"
#include "gimnet/gimi/outcome.hpp"

namespace gimnet::gimi {

/// The process in which a part of a node was made. A child after fork() has a copy of it, whose
/// locks and threads are its parent's. Thread safety: any thread.
class Home {
 public:
  [[nodiscard]] bool left() const { return generation_ != nif::fork_generation(); }

 private:
  const std::uint32_t generation_ = nif::fork_generation();
};

/// What `call` answers; in a child after fork() a Failure `forked`, or nothing where the answer
/// cannot say so. The first thing that a function of gimnet/gimi.hpp does: a lock may be held for
/// ever there.
template <class Call>
auto at_home(const Home& home, const Call& call) {
  using Answer = decltype(call());
  if (!home.left()) return call();
  if constexpr (std::is_constructible_v<Answer, Failure>) {
    return Answer(Failure{Status::forked,
                          "the node belongs to the parent process: after fork(), join anew in the "
                          "child"});
  } else {
    return Answer();
  }
}

}  // namespace gimnet::gimi
