#pragma once

#include <string>

#include "base/result.hpp"

namespace gimnet::demo {

/// A new folder that only this user may enter, removed with everything in it when the object goes.
class TemporaryFolder {
 public:
  /// Makes it in TMPDIR, or in /tmp. Errors: no place for it.
  static Result<TemporaryFolder> make();

  TemporaryFolder(TemporaryFolder&& other) noexcept;
  TemporaryFolder& operator=(TemporaryFolder&& other) noexcept;
  ~TemporaryFolder();

  [[nodiscard]] const std::string& path() const { return path_; }
  /// The path of something in it.
  [[nodiscard]] std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  explicit TemporaryFolder(std::string path) : path_(std::move(path)) {}

  std::string path_;
};

}  // namespace gimnet::demo
