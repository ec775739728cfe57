#include "tools/gimnet/progress.hpp"

#include <unistd.h>

#include <cstdint>
#include <utility>

#include "base/clock.hpp"

namespace gimnet::tool {
namespace {

constexpr std::int64_t kFirstNs = 500'000'000;
constexpr std::int64_t kEachNs = 200'000'000;

}  // namespace

Progress::Progress(std::function<std::string()> text, int descriptor)
    : text_(std::move(text)), descriptor_(descriptor) {
  if (::isatty(descriptor) == 1) thread_ = std::thread([this] { run(); });
}

Progress::~Progress() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    changed_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
}

void Progress::run() {
  bool shown = false;
  std::int64_t next_ns = steady_now_ns() + kFirstNs;
  for (;;) {
    {
      const MutexLock lock(mutex_);
      while (!stopping_ && steady_now_ns() < next_ns)
        static_cast<void>(changed_.wait_until(mutex_, next_ns));
      if (stopping_) break;
    }
    write("\r" + text_() + "\x1b[K");
    shown = true;
    next_ns = steady_now_ns() + kEachNs;
  }
  if (shown) write("\r\x1b[K");
}

void Progress::write(const std::string& text) const {
  // A terminal that takes nothing is no reason to stop the work.
  static_cast<void>(!::write(descriptor_, text.data(), text.size()));
}

}  // namespace gimnet::tool
