#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "base/result.hpp"
#include "hub/control/state/hub_state.hpp"

namespace gimnet::hub {

/// The folder in which one hub keeps its state: a file `state`, and a file `lock` that keeps a
/// second hub out while this one lives. What stands there is not trusted: it is read within bounds,
/// links are not followed. A folder that no hub used before, that was opened and into which nothing
/// was kept is left empty. Where the lock cannot be had its file stays: to remove it without
/// holding it could take it from another hub. Thread safety: none. Ownership: of two descriptors.
/// Errors: sentences that name the file and say what to do.
class StateFolder {
 public:
  /// Creates the folder (mode 0700) where there is none, but not the one above it, and locks it.
  [[nodiscard]] static Result<std::unique_ptr<StateFolder>> open(const std::string& path);
  ~StateFolder();
  StateFolder(const StateFolder&) = delete;
  StateFolder& operator=(const StateFolder&) = delete;

  /// What a hub kept here; nothing: no hub has.
  [[nodiscard]] Result<std::optional<HubState>> read() const;
  /// Keeps it: when this returns "", neither a crash nor a loss of power takes it away. Otherwise
  /// why it was not written; what stood there before is still there then.
  [[nodiscard]] std::string write(const HubState& state);

  [[nodiscard]] const std::string& path() const { return path_; }
  /// A hub was here before, even if its state is gone.
  [[nodiscard]] bool was_used() const { return was_used_; }

 private:
  StateFolder(std::string path, int folder, int lock, bool was_used)
      : path_(std::move(path)), folder_(folder), lock_(lock), was_used_(was_used) {}

  const std::string path_;
  const int folder_;
  const int lock_;
  const bool was_used_;
  bool kept_ = false;  ///< something, since it was opened
};

}  // namespace gimnet::hub
