#pragma once

#include <functional>
#include <optional>
#include <vector>

namespace gimnet::test {

/// Runs both in one thread of their own and returns the numbers (SYS_...) of all system calls that
/// the second made, in their order, as the kernel tells them (seccomp). What a process does for its
/// memory and to tell the time is left out. Nothing: this kernel does not tell.
[[nodiscard]] std::optional<std::vector<int>> system_calls_of(const std::function<void()>& before,
                                                              const std::function<void()>& counted);

}  // namespace gimnet::test
