#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "hub/config/settings.hpp"
#include "hub/config/sources.hpp"

namespace gimnet::hub {

/// A whole hub in this process: shards, conductor, listeners, and what they share.
/// Thread safety: made, run and destroyed by one thread, which is the conductor's while it runs.
class Hub {
 public:
  /// The part of a hub that its successor in this process takes over.
  struct Succession {
    HubId id;
    std::vector<ListenUrl> listen;
    std::vector<DialledLink> links;
  };

  /// Listens, and starts the shards. `sources` is where the options came from, to be read again at
  /// SIGHUP. `former`: the hub that it succeeds. Errors: a sentence that says what could not be
  /// had.
  [[nodiscard]] static Result<std::unique_ptr<Hub>> start(
      const HubOptions& options, const ConfigSources& sources = {},
      const std::optional<Succession>& former = std::nullopt);
  ~Hub();
  Hub(const Hub&) = delete;
  Hub& operator=(const Hub&) = delete;

  /// The addresses that it listens on, as the command line writes them, separated by spaces.
  [[nodiscard]] std::string addresses() const;
  /// Serves until SIGTERM or SIGINT, and then until it has drained or a second signal comes. A hub
  /// whose drawn id another one keeps drains, too: then another one is to succeed it.
  std::optional<Succession> run();

 private:
  struct Parts;
  explicit Hub(std::unique_ptr<Parts> parts);
  const std::unique_ptr<Parts> parts_;
};

}  // namespace gimnet::hub
