#include "tools/gimnet/input.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

namespace gimnet::tool {
namespace {

/// Room for a start if the size is not known before.
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
