// A configuration file of any bytes, read as the hub reads it: a configuration within all limits,
// which comes out the same after printing and reading it again, or faults, each with a place of its
// own in the file. A fault more does not hide the others. Input: the file.

#include "hub/config/sources.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "fuzz/support/fuzz_input.hpp"
#include "hub/config/toml_file.hpp"
#include "proto/control/names.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::hub;

/// A file in memory that has a path.
class File {
 public:
  File()
      : descriptor_(::memfd_create("hub.toml", MFD_CLOEXEC)),
        path_("/proc/self/fd/" + std::to_string(descriptor_)) {
    FUZZ_MUST(descriptor_ >= 0);
  }
  ~File() { ::close(descriptor_); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  ReadConfiguration read(std::string_view text) const {
    FUZZ_MUST(::ftruncate(descriptor_, 0) == 0);
    FUZZ_MUST(::pwrite(descriptor_, text.data(), text.size(), 0) ==
              static_cast<ssize_t>(text.size()));
    ReadConfiguration read = read_configuration({path_, {}, {}});
    FUZZ_MUST(read.files.size() == 1 && read.files.front() == path_);
    return read;
  }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  const int descriptor_;
  const std::string path_;
};

struct Position {
  std::size_t line = 0;
  std::size_t column = 0;
};

/// Of "PATH:LINE:COLUMN".
Position position_of(const ConfigFault& fault, const std::string& path) {
  FUZZ_MUST(fault.place.starts_with(path + ":"));
  char* end = nullptr;
  Position position;
  position.line = std::strtoul(fault.place.c_str() + path.size() + 1, &end, 10);
  FUZZ_MUST(*end == ':');
  position.column = std::strtoul(end + 1, &end, 10);
  FUZZ_MUST(*end == '\0');
  return position;
}

std::size_t line_count(std::string_view text) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')) + 1;
}

void check_faults(const Faults& faults, std::string_view text, const std::string& path) {
  std::set<std::string> seen;
  for (const ConfigFault& fault : faults) {
    const Position position = position_of(fault, path);
    // One line and one column behind the end: what is missing there.
    FUZZ_MUST(position.line >= 1 && position.line <= line_count(text) + 1);
    FUZZ_MUST(position.column >= 1 && position.column <= text.size() + 2);
    FUZZ_MUST(!fault.sentence.empty() && fault.sentence.find('\n') == std::string::npos);
    FUZZ_MUST(seen.insert(fault.line()).second);
  }
}

void check_options(const HubOptions& options) {
  for (const LimitInfo& limit : limit_table()) {
    const std::uint64_t value = options.limits.*limit.field;
    FUZZ_MUST(value >= limit.least && value <= limit.most);
  }
  FUZZ_MUST(options.shards >= 1 && options.shards <= kShardCountMax);
  FUZZ_MUST(options.id.value() >= 1 && options.id.value() <= kHubIdMax);
  FUZZ_MUST(proto::valid_name(options.shown_name()));
  FUZZ_MUST(options.limits.silent_ms > options.limits.keep_alive_ms);
  const bool local =
      std::ranges::all_of(options.listen, [](const ListenUrl& url) { return url.is_local(); });
  FUZZ_MUST(local || options.insecure);
  std::set<std::string> names;
  for (const DialledLink& link : options.links.dial) {
    FUZZ_MUST(names.insert(link.name).second && !link.name.empty());
    FUZZ_MUST(is_local(link.address) || options.insecure);
    FUZZ_MUST(link.terms.silent_ms > link.terms.keep_alive_ms);
  }
  FUZZ_MUST(options.links.accepted.silent_ms > options.links.accepted.keep_alive_ms);
}

/// A printed configuration is read as the same configuration.
void check_printed(const Configuration& configuration, const File& file) {
  const ReadConfiguration again = file.read(print(configuration));
  FUZZ_MUST(again.faults.empty());
  const HubOptions& options = again.configuration.options;
  for (const Setting& setting : settings())
    FUZZ_MUST(setting.show(options) == setting.show(configuration.options));
  for (const LimitInfo& limit : limit_table()) {
    FUZZ_MUST(options.limits.*limit.field == configuration.options.limits.*limit.field);
  }
}

/// Was the file read, and is the fault about what it says?
bool is_about_a_value(const ConfigFault& fault) {
  for (const std::string_view unread : {"this is not ", "is given twice", "is not UTF-8",
                                        "does not fit in 64 bits", "no key has so many parts"}) {
    if (fault.sentence.find(unread) != std::string::npos) return false;
  }
  return true;
}

/// Faults of the same text with a wrong line before it: that one, and all the others, a line
/// further down.
void check_one_fault_more(const Faults& faults, std::string_view text, const File& file) {
  constexpr std::string_view kWrong = "a_key_that_nobody_knows = 1\n";
  if (!std::ranges::all_of(faults, is_about_a_value)) return;
  if (text.starts_with("\xEF\xBB\xBF")) return;
  if (text.size() + kWrong.size() > kConfigBytesMax) return;
  const ReadConfiguration more = file.read(std::string{kWrong} + std::string{text});
  std::multiset<std::pair<std::size_t, std::size_t>> due;
  for (const ConfigFault& fault : faults) {
    const Position position = position_of(fault, file.path());
    due.emplace(position.line + 1, position.column);
  }
  due.emplace(1, 1);
  std::multiset<std::pair<std::size_t, std::size_t>> found;
  for (const ConfigFault& fault : more.faults) {
    const Position position = position_of(fault, file.path());
    found.emplace(position.line, position.column);
  }
  FUZZ_MUST(found == due);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const File file;
  const ReadConfiguration read = file.read(text);
  check_faults(read.faults, text, file.path());
  if (read.faults.empty()) {
    check_options(read.configuration.options);
    check_printed(read.configuration, file);
  }
  check_one_fault_more(read.faults, text, file);
  return 0;
}
