#pragma once

#include <cstdio>
#include <cstdlib>

namespace gimnet {

/// Says which invariant broke and where, and aborts: better a restart than a frame to the wrong
/// node.
[[noreturn]] inline void broken_invariant(const char* condition, const char* file, int line) {
  std::fprintf(stderr, "gimnet: broken invariant: %s (%s:%d)\n", condition, file, line);
  std::abort();
}

}  // namespace gimnet

/// For invariants whose check is cheap: aborts in every build. Never for input from the network.
#define GIMNET_CHECK(condition) \
  ((condition) ? static_cast<void>(0) : ::gimnet::broken_invariant(#condition, __FILE__, __LINE__))

/// For preconditions on hot paths: aborts in debug builds, costs nothing in release.
#ifdef NDEBUG
#define GIMNET_ASSERT(condition) static_cast<void>(sizeof(static_cast<bool>(condition)))
#else
#define GIMNET_ASSERT(condition) GIMNET_CHECK(condition)
#endif
