#include "hub/config/sources.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/descriptor.hpp"
#include "base/log.hpp"
#include "base/suggest.hpp"
#include "hub/config/toml_file.hpp"

namespace gimnet::hub {
namespace {

namespace fs = std::filesystem;

/// A whole file, or why it cannot be had.
struct ConfigText {
  std::string text;   ///< of a longer file kConfigBytesMax + 1 bytes
  std::string error;  ///< what is wrong, and what to do
};

ConfigText no_text(int code) {
  const char* remedy = "give the path of a TOML file with --config, or, in conf.d, take it away";
  if (code == ENOENT) remedy = "make it, it may be empty; or give another one with --config";
  if (code == EACCES) remedy = "give the user that runs tcphub the right to read it";
  if (code == EMFILE) remedy = "raise the limit on descriptors (ulimit -n), or let a node go";
  return {{}, std::generic_category().message(code) + "; " + remedy};
}

/// Reads a regular file, and /dev/null as an empty one. All else is an error and is not waited for.
ConfigText read_config_text(const std::string& path) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC));
  struct stat info{};
  if (file.get() < 0 || ::fstat(file.get(), &info) != 0) return no_text(errno);
  if (S_ISDIR(info.st_mode)) return no_text(EISDIR);
  const bool null = S_ISCHR(info.st_mode) && info.st_rdev == makedev(1, 3);
  if (!S_ISREG(info.st_mode) && !null)
    return {{}, "it is a pipe or a device; put a regular file in its place"};
  ConfigText whole;
  // One byte more than a configuration may have shows that it is too long.
  while (whole.text.size() <= kConfigBytesMax) {
    const std::size_t before = whole.text.size();
    const std::size_t wanted = std::min<std::size_t>(kConfigBytesMax + 1 - before, 64 * 1024);
    whole.text.resize(before + wanted);
    const ssize_t got = ::read(file.get(), whole.text.data() + before, wanted);
    if (got < 0 && errno != EINTR) return no_text(errno);
    whole.text.resize(before + static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
    if (got == 0) break;
  }
  return whole;
}

constexpr std::string_view kPrefix = "TCPHUB_";
constexpr std::string_view kLimitsPrefix = "TCPHUB_LIMITS_";
constexpr std::string_view kFileVariable = "TCPHUB_CONFIG";
constexpr std::string_view kProxyVariable = "GIMNET_PROXY=";

/// As a variable's name has it.
std::string upper(std::string_view text) {
  std::string result{text};
  std::ranges::replace(result, '.', '_');
  std::ranges::transform(result, result.begin(),
                         [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return result;
}

/// "" for a variable that is no key.
std::string key_of(std::string_view variable) {
  for (const Setting& setting : settings()) {
    if (variable == std::string{kPrefix} + upper(setting.key)) return std::string{setting.key};
  }
  for (const LimitInfo* limit : limit_settings()) {
    if (variable == std::string{kLimitsPrefix} + upper(limit->name))
      return "limits." + std::string{limit->name};
  }
  return {};
}

std::string nearest_variable(std::string_view variable) {
  std::vector<std::string> all{std::string{kFileVariable}};
  for (const Setting& setting : settings())
    all.push_back(std::string{kPrefix} + upper(setting.key));
  for (const LimitInfo* limit : limit_settings())
    all.push_back(std::string{kLimitsPrefix} + upper(limit->name));
  const std::vector<std::string_view> views(all.begin(), all.end());
  return did_you_mean(variable, views);
}

/// Addresses and hubs stand side by side in a variable, with blanks or commas between them.
std::vector<ConfigValue> split(std::string_view text) {
  constexpr std::string_view kBetween = ", \t";
  std::vector<ConfigValue> parts;
  for (std::size_t at = text.find_first_not_of(kBetween); at != std::string_view::npos;) {
    const std::size_t end = std::min(text.find_first_of(kBetween, at), text.size());
    parts.push_back({ConfigValue::Kind::words, std::string{text.substr(at, end - at)}, {}, {}});
    at = text.find_first_not_of(kBetween, end);
  }
  return parts;
}

Given from_environment(const std::string& variable, const std::string& key, std::string_view text) {
  Given given;
  given.key = key;
  given.label = variable;
  given.origin = "environment " + variable;
  given.value.text = text;
  if (key == "listen" || key == "link" || key == "links.allow") {
    given.value.kind = ConfigValue::Kind::list;
    given.value.items = split(text);
  }
  return given;
}

void read_one(const std::string& path, ReadConfiguration& read) {
  const ConfigText file = read_config_text(path);
  read.files.push_back(path);
  if (!file.error.empty()) {
    read.faults.push_back({path, "cannot read this file: " + file.error});
    return;
  }
  const TomlFile toml = read_toml(file.text, path);
  read.faults.insert(read.faults.end(), toml.faults.begin(), toml.faults.end());
  for (const Given& given : toml.keys) apply(read.configuration, given, read.faults);
}

/// The *.toml of the folder, by name.
std::vector<std::string> files_in(const fs::path& folder, Faults& faults) {
  std::vector<std::string> files;
  std::error_code error;
  const fs::file_status status = fs::status(folder, error);
  if (status.type() == fs::file_type::not_found) return files;
  if (!error && !fs::is_directory(status)) {
    faults.push_back({folder.string(),
                      "this is not a folder, of which the *.toml would be read; make it one, or "
                      "give it another name"});
    return files;
  }
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    // Hidden ones are no members: editors put their locks and copies beside a file.
    const bool hidden = entry->path().filename().native().starts_with('.');
    if (entry->path().extension() == ".toml" && !hidden) files.push_back(entry->path().string());
  }
  if (error)
    faults.push_back(
        {folder.string(), "cannot read this folder: " + error.message() + "; give it rights"});
  std::ranges::sort(files);
  if (files.size() > kConfigFilesMax) {
    faults.push_back({folder.string(), "there are " + std::to_string(files.size()) +
                                           " files; at most " + std::to_string(kConfigFilesMax) +
                                           " are read"});
    files.clear();
  }
  return files;
}

/// The first of the default places where there is a file, or a conf.d that wants one; "": none.
std::string default_place() {
  std::error_code ignored;
  for (const std::string& file : default_config_files()) {
    const fs::path parts = fs::path{file}.parent_path() / "conf.d";
    if (fs::exists(file, ignored) || fs::is_directory(parts, ignored)) return file;
  }
  return {};
}

}  // namespace

std::vector<std::string> default_config_files() {
  std::vector<std::string> files;
  const char* config = std::getenv("XDG_CONFIG_HOME");
  const char* home = std::getenv("HOME");
  if (config != nullptr && *config == '/') {
    files.push_back(std::string{config} + "/gimnet/tcphub.toml");
  } else if (home != nullptr && *home == '/') {
    files.push_back(std::string{home} + "/.config/gimnet/tcphub.toml");
  }
  files.emplace_back("/etc/gimnet/tcphub.toml");
  return files;
}

std::vector<std::string> read_environment(ConfigSources& sources, const char* const* environment) {
  std::vector<std::string> warnings;
  for (; *environment != nullptr; ++environment) {
    const std::string_view entry = *environment;
    const std::size_t equals = entry.find('=');
    if (entry.starts_with(kProxyVariable) && sources.proxy.empty())
      sources.proxy = entry.substr(equals + 1);
    if (!entry.starts_with(kPrefix) || equals == std::string_view::npos) continue;
    const std::string variable{entry.substr(0, equals)};
    const std::string_view value = entry.substr(equals + 1);
    if (variable == kFileVariable) {
      if (!sources.file.empty()) continue;
      sources.file = value;
      if (value.empty())
        sources.faults.push_back(
            {{}, variable + " is empty: give it a TOML file's path, or unset it"});
    } else if (const std::string key = key_of(variable); !key.empty()) {
      sources.environment.push_back(from_environment(variable, key, value));
    } else {
      warnings.push_back("the environment's " + escaped(variable, kQuotedMax) +
                         " is no key of the configuration" + nearest_variable(variable));
    }
  }
  std::ranges::sort(sources.environment, {}, &Given::label);
  return warnings;
}

ReadConfiguration read_configuration(const ConfigSources& sources) {
  ReadConfiguration read;
  read.faults = sources.faults;
  read.configuration.options.shards = default_shards();
  read.configuration.proxy = sources.proxy;
  read.file = sources.file.empty() ? default_place() : sources.file;
  if (!read.file.empty()) {
    read_one(read.file, read);
    for (const std::string& part :
         files_in(fs::path{read.file}.parent_path() / "conf.d", read.faults))
      read_one(part, read);
  }
  for (const Given& given : sources.environment) apply(read.configuration, given, read.faults);
  for (const Given& given : sources.flags) apply(read.configuration, given, read.faults);
  complete(read.configuration, read.faults);
  return read;
}

Reloading Reloader::read_again() {
  Reloading reloading;
  const ReadConfiguration read = read_configuration(sources_);
  const std::size_t told = std::min(read.faults.size(), kReloadFaultsMax);
  for (const ConfigFault& fault : std::span(read.faults).first(told))
    reloading.faults.push_back(fault.line());
  reloading.more_faults = told < read.faults.size();
  if (!reloading.faults.empty()) return reloading;
  // A file that appeared in a default place is the hub's from now on, and must not go unnoticed
  // when it goes.
  sources_.file = read.file;
  const HubOptions& wanted = read.configuration.options;
  for (const Setting& setting : settings()) {
    std::string from = setting.show(in_force_);
    std::string to = setting.show(wanted);
    if (from == to) continue;
    reloading.changes.push_back(
        {std::string{setting.key}, std::move(from), std::move(to), !setting.reloads});
  }
  for (const LimitInfo& limit : limit_table()) {
    const std::uint64_t from = in_force_.limits.*limit.field;
    const std::uint64_t to = wanted.limits.*limit.field;
    if (from == to) continue;
    reloading.changes.push_back({"limits." + std::string{limit.name}, std::to_string(from),
                                 std::to_string(to), !limit.reloads});
    if (limit.reloads) in_force_.limits.*limit.field = to;
  }
  in_force_.log_level = wanted.log_level;
  reloading.log_level = wanted.log_level;
  reloading.limits = in_force_.limits;
  return reloading;
}

}  // namespace gimnet::hub
