#pragma once

#include <algorithm>
#include <cstddef>
#include <exception>
#include <new>
#include <string>
#include <utility>

#include "client/nif/answer_status.hpp"
#include "client/nif/error.hpp"
#include "client/nif/handles.hpp"
#include "client/nif/node.hpp"
#include "proto/control/names.hpp"
#include "proto/control/ns.hpp"

// The common parts of the functions of the C API: guards, and questions about names.

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
    if (node.thread().is_current())
      return fail(NIF_IN_CALLBACK, "a call that waits for the hub was made in the callback");
    return body(node);
  });
}

inline nif_status refused(const char* what, const std::string& about,
                          const proto::Refusal& refusal) {
  const std::string why =
      refusal.sentence.empty() ? proto::status_name(refusal.status) : refusal.sentence;
  std::string doing = std::string("cannot ") + what;
  if (!about.empty()) doing += " '" + about + "'";  // empty: a pattern that stands for all
  return fail(status_of(refusal.status), doing + ": " + why);
}

/// Asks, and reads the answer. `what` and `about` are for the sentence.
template <class Answer, class Request>
nif_status ask(Node& node, const Request& request, Answer& answer, const char* what,
               const std::string& about, Deadline deadline) {
  proto::Payload payload;
  const nif_status status =
      node.requests().ask(proto::Kind::ns, proto::encode(request), payload, deadline);
  if (status != NIF_OK) return status;
  auto decoded = proto::decode_answer<Answer>(payload);
  if (!decoded) return refused(what, about, decoded.error());
  answer = std::move(*decoded);
  return NIF_OK;
}

/// `fault_of`: the rules, proto::name_fault or a stricter one.
inline nif_status check_name(const char* name, const char* what,
                             const char* (*fault_of)(std::string_view) = proto::name_fault) {
  if (name == nullptr)
    return fail(NIF_BAD_ARGUMENT, std::string("cannot ") + what + ": name is NULL");
  const char* fault = fault_of(name);
  if (fault == nullptr) return NIF_OK;
  return fail(NIF_BAD_NAME, std::string("cannot ") + what + " '" + name + "': " + fault);
}

inline nif_status check_pattern(const char* pattern) {
  if (pattern == nullptr || *pattern == '\0' || proto::valid_pattern(pattern)) return NIF_OK;
  const std::string text = pattern;
  std::string fault =
      "it is not a pattern: parts are separated by one /, and one is letters, digits, '.', '_', "
      "'-', or * for any one "
      "part, or ** for any number of them";
  if (std::ranges::count(text, '/') >= static_cast<std::ptrdiff_t>(proto::kNamePartsMax)) {
    fault = "it has more than " + std::to_string(proto::kNamePartsMax) + " parts";
  }
  if (text.size() > proto::kNameBytesMax)
    fault = "it has more than " + std::to_string(proto::kNameBytesMax) + " bytes";
  return fail(NIF_BAD_NAME, "cannot look for '" + text + "': " + fault);
}

}  // namespace gimnet::nif
