#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace gimnet::tool {

/// Lines that were published while nobody had subscribed: the library sends them to nobody, and
/// only the publisher can say so. Thread safety: one thread.
class UnheardLines {
 public:
  /// The subscribers right before a line is published, and right behind. A line may or may not
  /// reach one that comes in between: that counts as heard.
  void before_line(std::size_t subscribers) { alone_ = subscribers == 0; }
  void after_line(std::size_t subscribers) {
    ++lines_;
    if (alone_ && subscribers == 0) ++unheard_;
  }
  /// The sentence about them; "" if there are none. `waited`: the first line was held until
  /// somebody had subscribed.
  [[nodiscard]] std::string sentence(const std::string& service, bool waited) const;

 private:
  bool alone_ = false;
  std::uint64_t lines_ = 0;
  std::uint64_t unheard_ = 0;
};

}  // namespace gimnet::tool
