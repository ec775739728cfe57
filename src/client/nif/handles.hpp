#pragma once

#include <cstdint>
#include <memory>

#include "client/nif/error.hpp"
#include "client/nif/node.hpp"
#include "gimnet/nif.h"

// From the handles of the C API to nodes. A handle is a number (slot and generation), so that one
// that was closed, or never was, is found out instead of followed. A slot's numbers come round
// after 2^32 handles, after 2^16 where pointers have 32 bits.

namespace gimnet::nif {

inline constexpr std::uint32_t kHandlesMax = 4096;

/// Keeps the node of a handle from being closed while a call is inside it. Move-only.
class NodeRef {
 public:
  NodeRef() = default;
  NodeRef(NodeRef&& other) noexcept;
  NodeRef& operator=(NodeRef&&) = delete;
  ~NodeRef();
  [[nodiscard]] explicit operator bool() const { return node_ != nullptr; }
  [[nodiscard]] Node* operator->() const { return node_; }
  [[nodiscard]] Node& operator*() const { return *node_; }

  /// NIF_OK, or why there is no node: NIF_CLOSED, NIF_FORKED. The sentence is stored.
  [[nodiscard]] nif_status status() const { return status_; }

 private:
  friend NodeRef find_node(const nif_node* handle);
  Node* node_ = nullptr;
  std::uint32_t slot_ = 0;
  nif_status status_ = NIF_CLOSED;
};

[[nodiscard]] NodeRef find_node(const nif_node* handle);

/// A new handle, which owns the node from then on, or null: kHandlesMax are open, and the node
/// stays the caller's.
[[nodiscard]] nif_node* add_node(std::unique_ptr<Node>& node);

/// The node of a handle, for a library above this one that calls it without a look-up each time. It
/// stays until that drops it; after close_node() it answers NIF_CLOSED. Null: no such handle.
[[nodiscard]] Node* share_node(const nif_node* handle);

/// Makes the handle invalid, has waiting calls leave, waits until they have, closes the node,
/// and drops it.
[[nodiscard]] nif_status close_node(nif_node* handle);

}  // namespace gimnet::nif
