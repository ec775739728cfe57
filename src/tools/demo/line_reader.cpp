#include "tools/demo/line_reader.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <zlib.h>

#include <cerrno>
#include <cstring>

namespace gimnet::demo {

void LineReader::Closer::operator()(gzFile_s* file) const { (void)gzclose(file); }

LineReader::LineReader(std::string path, gzFile_s* file)
    : path_(std::move(path)), file_(file), buffer_(kLineBytesMax + 1, '\0') {
  (void)gzbuffer(file, 1U << 16);
}

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

Result<bool> LineReader::next(std::string_view& line) {
  is_too_long_ = false;
  while (true) {
    const std::int64_t before = gztell(file_.get());
    const char* got = gzgets(file_.get(), buffer_.data(), static_cast<int>(buffer_.size()));
    const auto size = static_cast<std::size_t>(gztell(file_.get()) - before);
    int code = Z_OK;
    const char* text = gzerror(file_.get(), &code);
    const auto failure = [&](std::string_view what) {
      return Error{fmt::format("{}:{}: {}", path_, line_number_ + 1, what)};
    };
    if (code != Z_OK && code != Z_BUF_ERROR)
      return failure(fmt::format("damaged gzip archive ({}); copy the file again", text));
    if (before > kFileBytesMax) return failure("the file holds more than 1 GiB of text; cut it");
    const bool whole = got != nullptr && buffer_[size - 1] == '\n';
    // zlib tells by this code that the archive was cut; its last line is a part of a line.
    is_cut_ = code == Z_BUF_ERROR;
    if (is_cut_ && !whole) return false;
    if (got == nullptr && !is_too_long_) return false;
    if (got != nullptr && size == buffer_.size() - 1 && !whole) {
      is_too_long_ = true;
      continue;
    }
    ++line_number_;
    line = is_too_long_ ? std::string_view() : std::string_view(buffer_.data());
    if (line.ends_with('\n')) line.remove_suffix(1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    return true;
  }
}

}  // namespace gimnet::demo
