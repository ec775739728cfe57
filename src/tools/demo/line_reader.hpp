#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "base/result.hpp"

struct gzFile_s;

namespace gimnet::demo {

/// Reads a text file line by line; a file compressed with gzip is read as what it holds.
/// Ownership: closes its file. Thread safety: one thread. Limits: `kLineBytesMax` a line,
/// `kFileBytesMax` altogether, so that a hostile archive ends with a sentence and not with the
/// machine's memory.
class LineReader {
 public:
  static constexpr std::size_t kLineBytesMax = 1U << 20;
  static constexpr std::int64_t kFileBytesMax = 1LL << 30;

  /// Errors: no such file, not a regular file, not readable.
  static Result<LineReader> open(const std::string& path);

  /// Stores the next line without its end in `line`; false at the end of the file.
  /// A line beyond kLineBytesMax is given empty, with is_too_long(). A cut archive ends after its
  /// last whole line, with is_cut(). Of a line that holds a NUL only what stands before it is
  /// given. Errors: damaged archive, `kFileBytesMax` passed; the sentence names file and line.
  /// Valid until: the next call.
  [[nodiscard]] Result<bool> next(std::string_view& line);

  /// Number of the line that next() gave last, from 1.
  [[nodiscard]] std::uint64_t line_number() const { return line_number_; }
  /// The line that next() gave last was longer than kLineBytesMax.
  [[nodiscard]] bool is_too_long() const { return is_too_long_; }
  /// The gzip archive ended too early.
  [[nodiscard]] bool is_cut() const { return is_cut_; }

 private:
  struct Closer {
    void operator()(gzFile_s* file) const;
  };

  LineReader(std::string path, gzFile_s* file);

  std::string path_;
  std::unique_ptr<gzFile_s, Closer> file_;
  std::string buffer_;
  std::uint64_t line_number_ = 0;
  bool is_too_long_ = false;
  bool is_cut_ = false;
};

}  // namespace gimnet::demo
