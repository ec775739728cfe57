#include "tools/gimnet/output.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <utility>

#include "base/clock.hpp"
#include "base/standard_streams.hpp"

namespace gimnet::tool {
namespace {

constexpr std::size_t kGatheredBytes = 64 * 1024;

}  // namespace

void Output::write(std::string_view text) {
  if (waiting_.size() + text.size() > kGatheredBytes) flush();
  if (text.size() >= kGatheredBytes) {
    write_all(text);
  } else {
    waiting_ += text;
  }
}

void Output::flush() {
  write_all(waiting_);
  waiting_.clear();
}

bool Output::finish() {
  flush();
  if (ok() || error_ == EPIPE) return true;
  std::fprintf(stderr, "gimnet: cannot write to standard output: %s\n", std::strerror(error_));
  return false;
}

void Output::write_all(std::string_view text) {
  if (ok()) error_ = gimnet::write_all(descriptor_, text);
}

namespace {

constexpr std::int64_t kFirstNs = 500'000'000;
constexpr std::int64_t kEachNs = 200'000'000;

}  // namespace

ProgressLine::ProgressLine(std::function<std::string()> text, int descriptor)
    : text_(std::move(text)), descriptor_(descriptor) {
  if (::isatty(descriptor) == 1) thread_ = std::thread([this] { run(); });
}

ProgressLine::~ProgressLine() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    changed_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
}

void ProgressLine::run() {
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

void ProgressLine::write(const std::string& text) const {
  // A terminal that takes nothing is no reason to stop the work.
  static_cast<void>(!::write(descriptor_, text.data(), text.size()));
}

}  // namespace gimnet::tool
