#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "hub/config/settings.hpp"
#include "hub/config/toml_file.hpp"
#include "hub/config/value.hpp"

namespace gimnet::hub {

/// A whole file, or why it cannot be had.
struct ConfigText {
  std::string text;   ///< where it is longer, kConfigBytesMax + 1 bytes of it
  std::string error;  ///< what is wrong, and what to do
};

/// Reads a regular file, and /dev/null as an empty one. Folders, sockets and devices are errors. A
/// pipe is one unless `pipes`; it is then read to its end, however long that takes, and must not be
/// empty: a command that failed must not leave a hub with its defaults. Thread safety: any thread.
[[nodiscard]] ConfigText read_config_text(const std::string& path, bool pipes);

/// Most files in a conf.d.
inline constexpr std::size_t kConfigFilesMax = 256;

/// The sources of a hub's configuration, the weakest first: defaults, a file, the files in conf.d
/// beside it, the environment, the flags. Kept so that all of it can be read again. A value type.
struct ConfigSources {
  std::string
      file;  ///< of --config or TCPHUB_CONFIG; "": the first of the default places that is there
  std::vector<Given> environment;  ///< TCPHUB_...
  std::vector<Given> flags;
  Faults faults{};           ///< of how the file is named
  bool parts_alone = false;  ///< `file` was not there, only the conf.d beside it
  std::string proxy{};       ///< --proxy or GIMNET_PROXY; "": none
};

/// The place where the files were found.
struct ConfigPlace {
  std::string file;          ///< "": there is none
  bool parts_alone = false;  ///< as ConfigSources::parts_alone
};

/// The result of reading everything.
struct ReadConfiguration {
  Configuration configuration;  ///< whole only where there are no faults
  Faults faults;
  std::vector<std::string> files;  ///< that were read, the one beside conf.d first
  ConfigPlace place;               ///< to be read again
};

/// The places of the file if nobody says: the user's and the system's.
[[nodiscard]] std::vector<std::string> default_config_files();

/// The variables of this process that configure a hub; TCPHUB_CONFIG sets `sources.file` unless it
/// is set, and GIMNET_PROXY likewise `sources.proxy`. Warnings: variables that are no key.
[[nodiscard]] std::vector<std::string> read_environment(ConfigSources& sources,
                                                        const char* const* environment);

/// Reads everything; the file may be a pipe if `pipes`. Errors are faults: a file that is named and
/// not there, or cannot be read, or is no regular file, is one. Thread safety: any thread. Limits:
/// kConfigFilesMax files of kConfigBytesMax each. Blocks no longer than the disk, or the writer of
/// a pipe, does.
[[nodiscard]] ReadConfiguration read_configuration(const ConfigSources& sources,
                                                   bool pipes = false);

}  // namespace gimnet::hub
