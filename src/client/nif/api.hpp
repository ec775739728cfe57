#pragma once

#include <exception>
#include <new>

#include "client/nif/error.hpp"
#include "client/nif/handles.hpp"

// What the functions of the C API have in common.

namespace gimnet::nif {

/// Runs `body` so that no exception crosses into C.
template <class Body>
nif_status guarded(Body body) noexcept {
  try {
    return body();
  } catch (const std::bad_alloc&) {
    return fail(NIF_NO_MEMORY, "out of memory");
  } catch (const std::exception& error) {
    return fail(NIF_SYSTEM, error.what());
  }
}

/// Runs `body` with the handle's node, unless there is none.
template <class Body>
nif_status with_node(const nif_node* handle, Body body) noexcept {
  return guarded([&]() -> nif_status {
    const NodeRef node = find_node(handle);
    return node ? body(*node) : node.status();
  });
}

/// The same for calls that wait for an answer of the hub, which the library's own thread would have
/// to read.
template <class Body>
nif_status with_waiting_node(const nif_node* handle, Body body) noexcept {
  return with_node(handle, [&](Node& node) -> nif_status {
    if (node.in_callback())
      return fail(NIF_IN_CALLBACK, "a call that waits for the hub was made in the callback");
    return body(node);
  });
}

}  // namespace gimnet::nif
