#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <thread>

#include "base/mutex.hpp"

namespace gimnet::tool {

/// Standard output, gathered. Thread safety: one thread. Errors: ok() is false once it could not be
/// written.
class Output {
 public:
  explicit Output(int descriptor = 1) : descriptor_(descriptor) {}
  ~Output() { flush(); }
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;

  void write(std::string_view text);
  void write(std::span<const std::byte> bytes) {
    write(std::string_view{reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  }
  void flush();
  /// Writes what waits. False: it could not be written, and the words are printed. A reader that
  /// went away had enough: that is no failure.
  [[nodiscard]] bool finish();
  [[nodiscard]] bool ok() const { return error_ == 0; }
  /// The errno.
  [[nodiscard]] int error() const { return error_; }

 private:
  void write_all(std::string_view text);

  int descriptor_;
  std::string waiting_;
  int error_ = 0;
};

/// A line at a terminal that tells how far long work is, renewed some times a second and taken away
/// at the end. Not at a terminal: nothing. Work that is done at once shows none.
class ProgressLine {
 public:
  /// `text` is called on another thread until this goes. `descriptor`: of standard error.
  explicit ProgressLine(std::function<std::string()> text, int descriptor = 2);
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

 private:
  void run() GIMNET_EXCLUDES(mutex_);
  void write(const std::string& text) const;

  std::function<std::string()> text_;
  int descriptor_;
  Mutex mutex_;
  Condition changed_;
  bool stopping_ GIMNET_GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace gimnet::tool
