#include "tools/demo/temporary_folder.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <utility>

namespace gimnet::demo {
namespace {

// The path of a Unix socket has 107 bytes; the longest name in the folder takes 20 of them.
constexpr std::size_t kParentMax = 70;

}  // namespace

Result<TemporaryFolder> TemporaryFolder::make() {
  const char* given = std::getenv("TMPDIR");
  std::string parent = given != nullptr && *given != '\0' ? given : "/tmp";
  if (parent.size() > kParentMax) parent = "/tmp";
  std::string path = parent + "/gimnet-demo.XXXXXX";
  if (::mkdtemp(path.data()) == nullptr) {
    return Error{
        fmt::format("cannot make a folder in {}: {}; set TMPDIR to a place that can be written",
                    parent, std::strerror(errno))};
  }
  return TemporaryFolder(path);
}

TemporaryFolder::TemporaryFolder(TemporaryFolder&& other) noexcept
    : path_(std::exchange(other.path_, {})) {}

TemporaryFolder& TemporaryFolder::operator=(TemporaryFolder&& other) noexcept {
  std::swap(path_, other.path_);
  return *this;
}

TemporaryFolder::~TemporaryFolder() {
  if (path_.empty()) return;
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace gimnet::demo
