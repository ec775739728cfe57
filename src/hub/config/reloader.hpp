#pragma once

#include <chrono>
#include <functional>
#include <future>
#include <optional>

#include "hub/config/settings.hpp"
#include "hub/config/sources.hpp"
#include "hub/control/reloading.hpp"

namespace gimnet::hub {

/// Reads the configuration on a thread of its own, so that a disk that does not answer (one of
/// another machine that is gone) holds nobody up for longer than `patience`. A thread that is held
/// up is left alone: the system lets go of it when the disk answers, or the process ends. Thread
/// safety: one thread. Limits: one such thread.
class ConfigReader {
 public:
  /// A hub that reads admits nobody. Less than the time that `gimnet ctl` gives a hub to answer.
  static constexpr std::chrono::milliseconds kPatience{4'000};
  /// As read_configuration(). REQUIRES: may be called from any thread, also after the ConfigReader
  /// is gone.
  using Read = std::function<ReadConfiguration(const ConfigSources&, const ReadOptions&)>;

  explicit ConfigReader(Read read = read_configuration,
                        std::chrono::milliseconds patience = kPatience)
      : read_(std::move(read)), patience_(patience) {}

  /// Nothing: it was not there in time, or an earlier reading is still held up. Throws
  /// std::system_error where no thread can be had.
  [[nodiscard]] std::optional<ReadConfiguration> read(const ConfigSources& sources,
                                                      const ReadOptions& how);

 private:
  const Read read_;
  const std::chrono::milliseconds patience_;
  std::future<ReadConfiguration> begun_;  ///< of a reading that was not waited for to its end
};

/// Faults of the files that are told, and logged, at a reload: a hub that runs has more to do.
inline constexpr std::size_t kReloadFaultsMax = 100;

/// Knows where a running hub's configuration came from and what of it is in force. Thread safety:
/// one thread.
class Reloader {
 public:
  Reloader(ConfigSources sources, HubOptions in_force, ConfigReader reader = ConfigReader{})
      : reader_(std::move(reader)), sources_(std::move(sources)), in_force_(std::move(in_force)) {}

  /// Reads everything again. With faults nothing changes, one of which is a disk that does not
  /// answer; without, what may change while a hub runs is in force from now on for the next
  /// comparison.
  [[nodiscard]] Reloading read_again();
  /// The log level was set by other means.
  void note_log_level(LogLevel level) { in_force_.log_level = level; }

 private:
  ConfigReader reader_;
  ConfigSources sources_;
  HubOptions in_force_;
};

}  // namespace gimnet::hub
