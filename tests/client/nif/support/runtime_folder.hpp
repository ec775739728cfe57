#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/client/nif/support/environment.hpp"

namespace gimnet::nif::test {

/// A runtime folder of the test's own, XDG_RUNTIME_DIR while it lives. REQUIRES: one thread.
class RuntimeFolder {
 public:
  RuntimeFolder() : path_(made()), variable_("XDG_RUNTIME_DIR", path_.c_str()) {}
  ~RuntimeFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  RuntimeFolder(const RuntimeFolder&) = delete;
  RuntimeFolder& operator=(const RuntimeFolder&) = delete;

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] std::string tokens() const { return path_ + "/gimnet/tokens"; }

 private:
  static std::string made() {
    std::string path = ::testing::TempDir() + "nif_runtime_XXXXXX";
    EXPECT_NE(::mkdtemp(path.data()), nullptr);
    return path;
  }

  const std::string path_;
  const Environment variable_;
};

}  // namespace gimnet::nif::test
