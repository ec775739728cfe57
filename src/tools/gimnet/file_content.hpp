#pragma once

#include <cstddef>
#include <cstdlib>
#include <memory>
#include <span>
#include <string>

#include "gimnet/gimi/outcome.hpp"

namespace gimnet::tool {

/// `error` is an errno.
[[nodiscard]] Failure cannot_read(const std::string& what, int error);

/// All bytes of a file, a pipe or a device, in memory once. Thread safety: immutable.
class FileContent {
 public:
  /// Reads it. Errors: system (the sentence names the file and says why), too_large (over
  /// `bytes_max`; of a file known before it is read).
  [[nodiscard]] static Outcome<FileContent> read(const std::string& path, std::size_t bytes_max);
  [[nodiscard]] std::span<const std::byte> bytes() const { return {memory_.get(), size_}; }

 private:
  struct Free {
    void operator()(std::byte* memory) const { std::free(memory); }
  };
  [[nodiscard]] Outcome<void> fill(int file, const std::string& path, std::size_t bytes_max);
  /// Makes it so large, without a second copy of what is there where the system can do that.
  [[nodiscard]] bool grow(std::size_t capacity);

  std::unique_ptr<std::byte, Free> memory_;
  std::size_t capacity_ = 0;
  std::size_t size_ = 0;
};

}  // namespace gimnet::tool
