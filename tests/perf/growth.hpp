#pragma once

#include <cstddef>
#include <functional>

namespace gimnet::hub {

/// One amount of a script, to be run and counted as often as wanted.
using Work = std::function<void()>;

/// Ends the program with this sentence.
[[noreturn]] void wrong(const char* what);

// Of the data plane.
/// Sessions of so many nodes end, one after the other, each with one service whose last message the
/// hub keeps.
[[nodiscard]] Work retained(std::size_t count);
/// So many frames of 16 bytes in turns to the same 8 nodes of a hub that has an eightieth as many
/// nodes, 800 a turn.
[[nodiscard]] Work forwarding(std::size_t count);

// Of the library.
/// So many messages come into one queue and are taken out, beside as many other queues.
[[nodiscard]] Work queues(std::size_t count);
/// The same with all queues in a wait set, which tells of each message.
[[nodiscard]] Work wait_set(std::size_t count);

}  // namespace gimnet::hub
