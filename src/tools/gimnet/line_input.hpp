#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string_view>
#include <utility>
#include <vector>

namespace gimnet::tool {

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
