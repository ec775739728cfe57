#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

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

/// The lines of a descriptor, without their newline; the last one need not have one. Waits for
/// them, for a second descriptor that ends the waiting, and asks now and then whether to go on.
/// Thread safety: one thread. Memory: the longest line.
class LineInput {
 public:
  /// `stop`: readable when the waiting should end; -1: none. Neither is closed. `go_on` is asked
  /// each half second without a line; empty: nobody is.
  explicit LineInput(int input, int stop = -1, std::function<bool()> go_on = {})
      : input_(input), stop_(stop), go_on_(std::move(go_on)) {}

  enum class State : std::uint8_t {
    line,
    end,
    stopped,   ///< by the second descriptor
    given_up,  ///< go_on() said no
    failed,
  };
  /// Valid until: the next call.
  [[nodiscard]] State next(std::string_view& line);
  /// Another line is here already.
  [[nodiscard]] bool has_line() const;
  /// State::failed: the errno.
  [[nodiscard]] int error() const { return error_; }

 private:
  [[nodiscard]] State fill();

  int input_;
  int stop_;
  std::function<bool()> go_on_;
  std::vector<char> buffer_;
  std::size_t begin_ = 0;  ///< of the next line
  std::size_t end_ = 0;    ///< of what was read
  std::size_t searched_ = 0;
  bool at_end_ = false;
  int error_ = 0;
};

}  // namespace gimnet::tool
