#include "base/runtime_folder.hpp"

#include <unistd.h>

#include <cstdlib>
#include <utility>

namespace gimnet {
namespace {

/// "" where it is not set, or no absolute path.
std::string absolute(const char* variable) {
  const char* value = std::getenv(variable);
  return value != nullptr && *value == '/' ? value : "";
}

}  // namespace

RuntimeFolder runtime_folder_of_user() {
  if (std::string given = absolute("XDG_RUNTIME_DIR"); !given.empty())
    return {std::move(given), "gimnet", true};
  std::string temporary = absolute("TMPDIR");
  if (temporary.empty()) temporary = "/tmp";
  return {std::move(temporary), "gimnet-" + std::to_string(::geteuid()), false};
}

}  // namespace gimnet
