#include "hub/config/config_reader.hpp"

#include <thread>
#include <utility>

namespace gimnet::hub {

std::optional<ReadConfiguration> ConfigReader::read(const ConfigSources& sources,
                                                    const ReadOptions& how) {
  using std::future_status;
  if (begun_.valid() && begun_.wait_for(std::chrono::seconds{0}) != future_status::ready)
    return std::nullopt;
  std::packaged_task<ReadConfiguration()> reading(
      [read = read_, sources, how] { return read(sources, how); });
  begun_ = reading.get_future();
  std::thread(std::move(reading)).detach();
  if (begun_.wait_for(patience_) != future_status::ready) return std::nullopt;
  return begun_.get();
}

}  // namespace gimnet::hub
