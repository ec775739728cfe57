#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

#include "gimnet/nif.h"

namespace gimnet::stress {

/// A node of the library, as programs use it. Closed when this goes. Thread safety: as nif.h says.
class NifNode {
 public:
  /// `options` without url and name. Throws where the hub does not admit it.
  NifNode(const std::string& url, const char* name, nif_options options = {}) {
    options.struct_size = sizeof options;
    options.url = url.c_str();
    options.name = name;
    if (nif_connect(&options, &node_) != NIF_OK) throw std::runtime_error(nif_error_text());
  }
  NifNode(const NifNode&) = delete;
  NifNode& operator=(const NifNode&) = delete;
  ~NifNode() { static_cast<void>(nif_close(node_)); }

  [[nodiscard]] nif_node* get() const { return node_; }
  [[nodiscard]] std::uint32_t id() const { return nif_id(node_); }
  [[nodiscard]] nif_counters counters() const {
    nif_counters counters{};
    counters.struct_size = sizeof counters;
    static_cast<void>(nif_get_counters(node_, &counters));
    return counters;
  }

 private:
  nif_node* node_ = nullptr;
};

/// The latest received item. Ownership: its memory, until the next one or its own end.
class Incoming {
 public:
  Incoming() = default;
  Incoming(const Incoming&) = delete;
  Incoming& operator=(const Incoming&) = delete;
  ~Incoming() { release(); }
  /// nif_receive(); gives back what was received before.
  [[nodiscard]] nif_status receive(const NifNode& node, std::int32_t timeout_ms) {
    release();
    const nif_status status = nif_receive(node.get(), &in_, timeout_ms);
    has_ = status == NIF_OK;
    return status;
  }
  [[nodiscard]] const nif_incoming* operator->() const { return &in_; }

 private:
  void release() {
    if (std::exchange(has_, false)) nif_release(&in_);
  }
  nif_incoming in_{};
  bool has_ = false;
};

}  // namespace gimnet::stress
