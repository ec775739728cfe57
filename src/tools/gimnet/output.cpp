#include "tools/gimnet/output.hpp"

#include <cerrno>
#include <cstdio>
#include <cstring>

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

}  // namespace gimnet::tool
