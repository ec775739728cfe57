#pragma once

#include <cstdint>
#include <string>

// The operating system as NIF asks it, streams apart (src/net). platform_linux.cpp implements it.

namespace gimnet::nif {

/// A descriptor of the system, -1: none.
using Descriptor = int;

/// "" where it is not set.
[[nodiscard]] std::string environment(const char* name);
/// The folder with the socket of this user's hub: runtime_folder_of_user(). One in the temporary
/// folder, where anybody can make folders, counts only if it is there, belongs to this user and is
/// closed to others; else "".
[[nodiscard]] std::string runtime_folder();

/// Changes in a child after fork(); never in the process that called it.
[[nodiscard]] std::uint32_t fork_generation();

}  // namespace gimnet::nif
