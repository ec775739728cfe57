#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "base/result.hpp"
#include "hub/control/listen_url.hpp"
#include "hub/control/state/hub_state.hpp"
#include "proto/control/hub_identity.hpp"

namespace gimnet::hub {

/// The folder in which one hub keeps its state: a file `state`, and a file `lock` that keeps a
/// second hub out while this one lives. What stands there is not trusted: it is read within bounds,
/// links are not followed. The folder and its files belong to the user that runs the hub. A hub
/// that kept nothing leaves an empty `lock`, which is no sign of a hub. Thread safety: none.
/// Ownership: of two descriptors. Errors: sentences that name the file and say what to do.
class StateFolder {
 public:
  /// Creates the folder (mode 0700) where there is none, but not the one above it, and locks it.
  [[nodiscard]] static Result<std::unique_ptr<StateFolder>> open(const std::string& path);
  ~StateFolder();
  StateFolder(const StateFolder&) = delete;
  StateFolder& operator=(const StateFolder&) = delete;

  /// The state that a hub kept here; nothing: no hub has.
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

/// Decides where a hub keeps its state, and from what it goes on.
struct StateWish {
  std::string folder;      ///< as the configuration says; "": the default
  bool draws_hub = false;  ///< it needs a hub id of its own, and has none configured
  HubId drawn{};           ///< that it drew in place of another one; 0: none
  ListenUrl address;       ///< the first that the hub was told to listen on, as it was told
  std::chrono::milliseconds wall{};  ///< since 1970
};

/// A hub's start, and where it keeps what has to outlive it.
struct StartState {
  HubStart start;
  proto::HubInstance instance;          ///< random
  std::unique_ptr<StateFolder> folder;  ///< null: in memory only
};

/// Finds out how the hub goes on and keeps that before it begins. Without a folder in the wish the
/// default is used: one for each first address, none where the system chooses the port, since then
/// nobody finds the hub again. Where the default folder cannot be had and no hub was
/// ever there, a warning is logged and the hub runs without, its first ids in a random place.
/// Errors: the folder that was asked for cannot be used, or what a hub kept there cannot be read or
/// gone on from.
[[nodiscard]] Result<StartState> start_state(const StateWish& wish);

/// "hub-tcp-127.0.0.1-7450", or "" for an address whose port the system chooses.
[[nodiscard]] std::string state_folder_name(const ListenUrl& address);

}  // namespace gimnet::hub
