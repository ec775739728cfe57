#pragma once

#include <chrono>
#include <functional>
#include <future>
#include <optional>

#include "hub/config/sources.hpp"

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

}  // namespace gimnet::hub
