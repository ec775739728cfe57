#include "tools/demo/line_reader.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <zlib.h>

#include <cerrno>
#include <cstring>

namespace gimnet::demo {

void LineReader::Closer::operator()(gzFile_s* file) const { (void)gzclose(file); }

LineReader::LineReader(std::string path, gzFile_s* file)
    : path_(std::move(path)), file_(file), buffer_(1U << 16) {}

Result<LineReader> LineReader::open(const std::string& path) {
  struct stat status{};
  if (::stat(path.c_str(), &status) != 0) {
    return Error{fmt::format("cannot open {}: {}; check the path", path, std::strerror(errno))};
  }
  if (!S_ISREG(status.st_mode)) {
    return Error{
        fmt::format("cannot read {}: it is not a regular file; give the path of a file", path)};
  }
  gzFile file = gzopen(path.c_str(), "rb");
  if (file == nullptr) {
    return Error{fmt::format("cannot open {}: {}", path,
                             errno != 0 ? std::strerror(errno) : "out of memory")};
  }
  return LineReader(path, file);
}

Error LineReader::failure(std::string_view what) const {
  return Error{fmt::format("{}:{}: {}", path_, line_number_ + 1, what)};
}

// Moves what is left to the front, doubles the buffer where a line fills it, and reads. False:
// nothing more came.
Result<bool> LineReader::fill() {
  std::memmove(buffer_.data(), buffer_.data() + begin_, end_ - begin_);
  end_ -= begin_;
  begin_ = 0;
  if (end_ == buffer_.size()) buffer_.resize(buffer_.size() * 2);
  const int got =
      gzread(file_.get(), buffer_.data() + end_, static_cast<unsigned>(buffer_.size() - end_));
  if (got <= 0) {
    int code = Z_OK;
    const char* text = gzerror(file_.get(), &code);
    // zlib tells of an archive that was cut only by this code, after it has given what it could
    // read.
    if (code == Z_BUF_ERROR) {
      is_cut_ = true;
      return false;
    }
    if (got < 0)
      return failure(fmt::format("damaged gzip archive ({}); copy the file again", text));
    return false;
  }
  end_ += static_cast<std::size_t>(got);
  bytes_read_ += static_cast<std::uint64_t>(got);
  if (bytes_read_ > kFileBytesMax) return failure("the file holds more than 1 GiB of text; cut it");
  return true;
}

Result<bool> LineReader::next(std::string_view& line) {
  std::size_t searched = begin_;
  is_too_long_ = false;
  while (true) {
    const void* found = std::memchr(buffer_.data() + searched, '\n', end_ - searched);
    if (found != nullptr || (at_end_ && (begin_ < end_ || is_too_long_))) {
      const std::size_t stop =
          found == nullptr
              ? end_
              : static_cast<std::size_t>(static_cast<const char*>(found) - buffer_.data());
      line = std::string_view(buffer_.data() + begin_, stop - begin_);
      if (is_too_long_) line = {};
      if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
      begin_ = found == nullptr ? end_ : stop + 1;
      ++line_number_;
      return true;
    }
    if (at_end_) return false;
    if (end_ - begin_ >= kLineBytesMax) {
      is_too_long_ = true;
      begin_ = end_;
    }
    searched = end_ - begin_;
    const Result<bool> more = fill();
    if (!more) return more.error();
    if (!*more) {
      at_end_ = true;
      // The last line of a cut archive is a part of a line.
      if (is_cut_) {
        begin_ = end_;
        is_too_long_ = false;
      }
      searched = begin_;
    }
  }
}

}  // namespace gimnet::demo
