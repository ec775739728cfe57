#pragma once

#include <cstdlib>
#include <string>

namespace gimnet::nif::test {

/// Sets a variable of the environment while it lives. REQUIRES: one thread.
class Environment {
 public:
  Environment(const char* name, const char* value)
      : name_(name), had_(std::getenv(name) != nullptr) {
    if (had_) former_ = std::getenv(name);
    ::setenv(name, value, 1);
  }
  ~Environment() {
    if (had_) {
      ::setenv(name_, former_.c_str(), 1);
    } else {
      ::unsetenv(name_);
    }
  }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  const char* name_;
  bool had_;
  std::string former_;
};

}  // namespace gimnet::nif::test
