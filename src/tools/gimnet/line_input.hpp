#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace gimnet::tool {

/// The lines of a descriptor, without their newline; the last one need not have one. Waits for them, and for a second
/// descriptor that ends the waiting. Thread safety: one thread. Memory: the longest line.
class LineInput {
 public:
  /// `stop`: readable when the waiting should end; -1: none. Neither is closed.
  explicit LineInput(int input, int stop = -1) : input_(input), stop_(stop) {}

  enum class State : std::uint8_t { line, end, stopped, failed };
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
  std::vector<char> buffer_;
  std::size_t begin_ = 0;  ///< of the next line
  std::size_t end_ = 0;    ///< of what was read
  std::size_t searched_ = 0;
  bool at_end_ = false;
  int error_ = 0;
};

}  // namespace gimnet::tool
