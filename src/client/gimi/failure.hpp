#pragma once

#include <string_view>

#include "gimnet/gimi/outcome.hpp"
#include "gimnet/gimi_types.h"

// The answers of the C API, and the sentence that stands behind one.

namespace gimnet::gimi {

/// Stores the sentence for gimi_error_text() of this thread and returns the status.
gimi_status fail(gimi_status status, std::string_view sentence);
inline gimi_status fail(const Failure& failure) {
  return fail(static_cast<gimi_status>(failure.status), failure.sentence);
}

}  // namespace gimnet::gimi
