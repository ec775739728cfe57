#pragma once

#include "gimnet/nif.h"
#include "proto/control/control_message.hpp"

namespace gimnet::nif {

/// A status of the wire, in C.
[[nodiscard]] constexpr nif_status status_of(proto::Status status) {
  switch (status) {
    case proto::Status::done:
      return NIF_OK;
    case proto::Status::not_supported:
      return NIF_NOT_SUPPORTED;
    case proto::Status::bad_request:
      return NIF_BAD_REQUEST;
    case proto::Status::not_found:
      return NIF_NOT_FOUND;
    case proto::Status::taken:
      return NIF_TAKEN;
    case proto::Status::denied:
      return NIF_DENIED;
    case proto::Status::limit:
    case proto::Status::rate:
      return NIF_LIMIT;
  }
  return NIF_REFUSED;
}

}  // namespace gimnet::nif
