#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

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

}  // namespace gimnet::tool
