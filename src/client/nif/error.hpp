#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "gimnet/nif.h"
#include "net/net_error.hpp"
#include "net/wait.hpp"

// The answers of calls, and the sentence that stands behind an answer.

namespace gimnet::nif {

/// The beginning of a text in UTF-8, of at most so many bytes, that ends between two characters. Of
/// what is no UTF-8 three bytes less may remain.
[[nodiscard]] inline std::string_view cut_text(std::string_view text, std::size_t bytes_max) {
  if (text.size() <= bytes_max) return text;
  const auto continues = [text](std::size_t at) {
    return (static_cast<unsigned char>(text[at]) & 0xC0) == 0x80;
  };
  std::size_t size = bytes_max;
  while (size > 0 && bytes_max - size < 3 && continues(size)) --size;
  return text.substr(0, size);
}

/// A failed step: the status and, for people, what happened, to what, and what to do.
struct Failure {
  nif_status status = NIF_OK;
  std::string sentence;
  bool nobody_listens = false;  ///< at the hub's address: its process is gone
  bool other_hubs_may = false;  ///< take the node: this one is away, full or ends
};

/// A failure to connect as the calls of NIF answer it.
[[nodiscard]] Failure failure_of(const net::NetError& error);

/// Stores the sentence for nif_error_text() of this thread and returns the status.
nif_status fail(nif_status status, std::string_view sentence);
nif_status fail(const Failure& failure);

/// The sentence that fail() stored last in this thread. Valid until: the next fail() of this
/// thread.
[[nodiscard]] const char* error_text();

using net::Deadline;
using net::kNever;
using net::kNsPerMs;

[[nodiscard]] inline Deadline deadline_after(std::int32_t timeout_ms) {
  return timeout_ms < 0 ? kNever : steady_now_ns() + timeout_ms * kNsPerMs;
}

}  // namespace gimnet::nif
