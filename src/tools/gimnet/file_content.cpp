#include "tools/gimnet/file_content.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace gimnet::tool {
namespace {

/// Where the size is not known before.
constexpr std::size_t kFirstBytes = std::size_t{1} << 20;

Failure too_large(const std::string& path, std::size_t bytes_max) {
  return {Status::too_large, "cannot send " + path + ": it is larger than a message can be, " +
                                 std::to_string(bytes_max) + " bytes; send it in parts"};
}

}  // namespace

Failure cannot_read(const std::string& what, int error) {
  return {Status::system, "cannot read " + what + ": " + std::strerror(error)};
}

Outcome<FileContent> FileContent::read(const std::string& path, std::size_t bytes_max) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return cannot_read(path, errno);
  FileContent content;
  auto filled = content.fill(file, path, bytes_max);
  ::close(file);
  if (!filled) return filled.failure();
  return content;
}

Outcome<void> FileContent::fill(int file, const std::string& path, std::size_t bytes_max) {
  struct stat about{};
  const bool known = ::fstat(file, &about) == 0 && S_ISREG(about.st_mode) && about.st_size > 0;
  if (known && static_cast<std::size_t>(about.st_size) > bytes_max)
    return too_large(path, bytes_max);
  // One more, so that the end of a file that does not grow is seen without growing.
  if (!grow(known ? static_cast<std::size_t>(about.st_size) + 1 : kFirstBytes))
    return cannot_read(path, ENOMEM);
  for (;;) {
    if (size_ == capacity_ && !grow(2 * capacity_)) return cannot_read(path, ENOMEM);
    const ssize_t count = ::read(file, memory_.get() + size_, capacity_ - size_);
    if (count == 0) return {};
    if (count < 0 && errno != EINTR) return cannot_read(path, errno);
    size_ += static_cast<std::size_t>(std::max<ssize_t>(count, 0));
    if (size_ > bytes_max) return too_large(path, bytes_max);
  }
}

bool FileContent::grow(std::size_t capacity) {
  auto* const larger = static_cast<std::byte*>(std::realloc(memory_.get(), capacity));
  if (larger == nullptr) return false;
  [[maybe_unused]] const std::byte* const former = memory_.release();  // realloc() has taken it
  memory_.reset(larger);
  capacity_ = capacity;
  return true;
}

}  // namespace gimnet::tool
