#include "client/nif/token_store.hpp"

#include <cstdint>
#include <cstdlib>
#include <span>
#include <string_view>

// The file that a program left behind. Whatever it holds is refused, or is what a node writes, byte
// for byte; and whatever a node and its hub are called, the file's name is one that a file system
// takes as it is.

namespace {

using namespace gimnet::nif;

void require(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto input = std::as_bytes(std::span{data, size});
  if (const auto record = read_token_record(input)) {
    const auto again = write_token_record(*record);
    require(again && std::equal(again->begin(), again->end(), input.begin(), input.end()));
  }
  const std::string_view text{reinterpret_cast<const char*>(data), size};
  const std::string name = token_file_name(text.substr(0, size / 2), text.substr(size / 2));
  require(name.size() <= 80 && !name.starts_with("..") && name.find('/') == std::string::npos);
  for (const char c : name) require(c > ' ' && c <= '~');
  return 0;
}
