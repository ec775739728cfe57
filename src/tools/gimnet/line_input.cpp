#include "tools/gimnet/line_input.hpp"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

namespace gimnet::tool {
namespace {

constexpr std::size_t kReadBytes = 64 * 1024;
constexpr int kAskMs = 500;

}  // namespace

LineInput::State LineInput::next(std::string_view& line) {
  for (;;) {
    const void* newline = searched_ < end_
                              ? std::memchr(buffer_.data() + searched_, '\n', end_ - searched_)
                              : nullptr;
    if (newline != nullptr) {
      const auto at = static_cast<std::size_t>(static_cast<const char*>(newline) - buffer_.data());
      line = {buffer_.data() + begin_, at - begin_};
      begin_ = searched_ = at + 1;
      return State::line;
    }
    searched_ = end_;
    if (at_end_) {
      if (begin_ == end_) return State::end;
      line = {buffer_.data() + begin_, end_ - begin_};
      begin_ = end_;
      return State::line;
    }
    if (const State state = fill(); state != State::line) return state;
  }
}

bool LineInput::has_line() const {
  return begin_ < end_ &&
         (at_end_ || std::memchr(buffer_.data() + begin_, '\n', end_ - begin_) != nullptr);
}

/// State::line: something was read, or the end.
LineInput::State LineInput::fill() {
  if (begin_ != 0) {
    std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
    end_ -= begin_;
    searched_ -= begin_;
    begin_ = 0;
  }
  if (buffer_.size() < end_ + kReadBytes)
    buffer_.resize(std::max(2 * buffer_.size(), end_ + kReadBytes));
  for (;;) {
    std::array<pollfd, 2> ready{pollfd{input_, POLLIN, 0}, pollfd{stop_, POLLIN, 0}};
    const int found = ::poll(ready.data(), ready.size(), go_on_ ? kAskMs : -1);
    if (found < 0 && errno != EINTR) break;
    if (found == 0 && !go_on_()) return State::given_up;
    if (found <= 0) continue;
    if ((ready[1].revents & POLLIN) != 0) return State::stopped;
    if (ready[0].revents == 0) continue;
    const ssize_t count = ::read(input_, buffer_.data() + end_, buffer_.size() - end_);
    if (count < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (count < 0) break;
    at_end_ = count == 0;
    end_ += static_cast<std::size_t>(count);
    return State::line;
  }
  error_ = errno;
  return State::failed;
}

}  // namespace gimnet::tool
