#include "hub/config/sources.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <string_view>
#include <system_error>
#include <tuple>
#include <utility>

#include "base/log.hpp"
#include "base/suggest.hpp"
#include "hub/config/config_text.hpp"
#include "hub/config/toml_file.hpp"

namespace gimnet::hub {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = "TCPHUB_";
constexpr std::string_view kLimitsPrefix = "TCPHUB_LIMITS_";
constexpr std::string_view kFileVariable = "TCPHUB_CONFIG";

std::string upper(std::string_view text) {
  std::string result{text};
  std::ranges::transform(result, result.begin(),
                         [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return result;
}

/// "" for a variable that is no key.
std::string key_of(std::string_view variable) {
  for (const Setting& setting : settings()) {
    if (variable == std::string{kPrefix} + upper(setting.key)) return std::string{setting.key};
  }
  for (const LimitInfo& limit : limit_table()) {
    if (variable == std::string{kLimitsPrefix} + upper(limit.name))
      return "limits." + std::string{limit.name};
  }
  return {};
}

std::string nearest_variable(std::string_view variable) {
  std::vector<std::string> all{std::string{kFileVariable}};
  for (const Setting& setting : settings())
    all.push_back(std::string{kPrefix} + upper(setting.key));
  for (const LimitInfo& limit : limit_table())
    all.push_back(std::string{kLimitsPrefix} + upper(limit.name));
  const std::vector<std::string_view> views(all.begin(), all.end());
  return did_you_mean(variable, views);
}

/// Addresses stand side by side in a variable, with blanks or commas between them.
std::vector<Value> split(std::string_view text) {
  constexpr std::string_view kBetween = ", \t";
  std::vector<Value> parts;
  for (std::size_t at = text.find_first_not_of(kBetween); at != std::string_view::npos;) {
    const std::size_t end = std::min(text.find_first_of(kBetween, at), text.size());
    parts.push_back({Value::Kind::words, std::string{text.substr(at, end - at)}, {}, {}});
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
  if (key == "listen") {
    given.value.kind = Value::Kind::list;
    given.value.items = split(text);
  }
  return given;
}

/// Line and column of a place.
std::pair<std::size_t, std::size_t> position_in(const std::string& place) {
  const std::size_t column = place.rfind(':');
  const std::size_t line = column == std::string::npos ? column : place.rfind(':', column - 1);
  if (line == std::string::npos) return {};
  return {std::strtoul(place.c_str() + line + 1, nullptr, 10),
          std::strtoul(place.c_str() + column + 1, nullptr, 10)};
}

/// By line and column.
void sort(Faults& faults) {
  using Placed = std::pair<std::pair<std::size_t, std::size_t>, Fault>;
  std::vector<Placed> placed;
  placed.reserve(faults.size());
  for (Fault& fault : faults) placed.emplace_back(position_in(fault.place), std::move(fault));
  std::ranges::sort(placed, [](const Placed& a, const Placed& b) {
    return std::tie(a.first, a.second.sentence) < std::tie(b.first, b.second.sentence);
  });
  for (std::size_t i = 0; i < faults.size(); ++i) faults[i] = std::move(placed[i].second);
}

void read_one(const std::string& path, const ReadOptions& how, ReadConfiguration& read) {
  if (read.more_faults) return;
  const ConfigText file = read_config_text(path, how.pipe_patience);
  read.files.push_back(path);
  if (!file.error.empty()) {
    read.faults.push_back({path, "cannot read this file: " + file.error});
    return;
  }
  // One more than is told, to know whether there are more.
  const std::size_t most = how.faults_max - std::min(how.faults_max, read.faults.size());
  TomlFile toml = read_toml(file.text, path);
  Faults faults = std::move(toml.faults);
  for (const Given& given : toml.keys) {
    if (faults.size() > most) break;
    apply(read.configuration, given, faults);
  }
  sort(faults);
  read.more_faults = faults.size() > most;
  if (read.more_faults) faults.resize(most);
  read.faults.insert(read.faults.end(), std::move_iterator(faults.begin()),
                     std::move_iterator(faults.end()));
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
  if (error) {
    faults.push_back({folder.string(), "cannot read this folder: " + error.message() +
                                           remedy_of(error, "give it rights")});
  }
  std::ranges::sort(files);
  if (files.size() > kConfigFilesMax) {
    faults.push_back({folder.string(), "there are " + std::to_string(files.size()) +
                                           " files; at most " + std::to_string(kConfigFilesMax) +
                                           " are read"});
    files.clear();
  }
  return files;
}

std::vector<std::string> parts_beside(const ConfigPlace& place, Faults& faults) {
  return files_in(fs::path{place.file}.parent_path() / "conf.d", faults);
}

/// The first of the default places where there is a file, or parts of one.
ConfigPlace default_place() {
  std::error_code ignored;
  for (const std::string& file : default_config_files()) {
    if (fs::exists(file, ignored)) return {file, false};
    if (!fs::is_directory(fs::path{file}.parent_path() / "conf.d", ignored)) continue;
    ConfigPlace parts{file, true};
    Faults faults;
    if (!parts_beside(parts, faults).empty() || !faults.empty()) return parts;
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

ReadConfiguration read_configuration(const ConfigSources& sources, const ReadOptions& how) {
  ReadConfiguration read;
  read.faults = sources.faults;
  read.configuration.options.shards = default_shards();
  read.place =
      sources.file.empty() ? default_place() : ConfigPlace{sources.file, sources.parts_alone};
  if (!read.place.file.empty()) {
    Faults of_folder;
    const std::vector<std::string> parts = parts_beside(read.place, of_folder);
    std::error_code ignored;
    // Where parts were enough they are so as long as there are any: a hub does not lose its
    // configuration unnoticed.
    const bool any_parts = !parts.empty() || !of_folder.empty();
    read.place.parts_alone =
        read.place.parts_alone && any_parts && !fs::exists(read.place.file, ignored);
    if (!read.place.parts_alone) read_one(read.place.file, how, read);
    read.faults.insert(read.faults.end(), of_folder.begin(), of_folder.end());
    ReadOptions only_files = how;
    only_files.pipe_patience = {};
    for (const std::string& part : parts) read_one(part, only_files, read);
  }
  for (const Given& given : sources.environment) apply(read.configuration, given, read.faults);
  for (const Given& given : sources.flags) apply(read.configuration, given, read.faults);
  complete(read.configuration, read.faults);
  if (read.faults.empty()) read.warnings = warnings_about(read.configuration);
  return read;
}

}  // namespace gimnet::hub
