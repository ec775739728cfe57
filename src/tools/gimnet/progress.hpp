#pragma once

#include <functional>
#include <string>
#include <thread>

#include "base/mutex.hpp"

namespace gimnet::tool {

/// A line at a terminal that tells how far long work is, renewed some times a second and taken away
/// at the end. Not at a terminal: nothing. Work that is done at once shows none.
class Progress {
 public:
  /// `text` is called on another thread until this goes. `descriptor`: of standard error.
  explicit Progress(std::function<std::string()> text, int descriptor = 2);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

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
