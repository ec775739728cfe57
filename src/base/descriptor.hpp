#pragma once

#include <unistd.h>

#include <string>
#include <system_error>
#include <utility>

namespace gimnet {

/// A file descriptor that is closed on the way out unless it was released; a negative one is none.
/// Thread safety: none.
class Descriptor {
 public:
  explicit Descriptor(int value) : value_(value) {}
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  [[nodiscard]] int get() const { return value_; }
  [[nodiscard]] bool is_open() const { return value_ >= 0; }
  /// The caller's from now on.
  [[nodiscard]] int release() { return std::exchange(value_, -1); }

 private:
  int value_;
};

/// The system's words for an errno: "No such file or directory".
[[nodiscard]] inline std::string system_text(int error) {
  return std::generic_category().message(error);
}

}  // namespace gimnet
