#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "base/ids.hpp"
#include "base/result.hpp"
#include "hub/config/state_folder.hpp"
#include "hub/control/listen_url.hpp"
#include "hub/control/state/hub_state.hpp"

namespace gimnet::hub {

/// What decides where a hub keeps its state, and from what it goes on.
struct StateWish {
  std::string folder;  ///< as the configuration says; "": the default
  HubId hub;
  ListenUrl address;  ///< the first that the hub was told to listen on, as it was told
  std::chrono::milliseconds wall{};  ///< since 1970
};

/// A hub's start, and where it keeps what has to outlive it.
struct StartState {
  HubStart start;
  std::unique_ptr<StateFolder> folder;  ///< null: in memory only
};

/// Finds out how the hub goes on and keeps that before it begins. Without a folder in the wish the
/// default is used: one for each hub id and first address, none where the system chooses the port,
/// since then nobody finds the hub again. Where the default folder cannot be had and no hub was
/// ever there, a warning is logged and the hub runs without, its first ids in a random place.
/// Errors: the folder that was asked for cannot be used, or what a hub kept there cannot be read or
/// gone on from.
[[nodiscard]] Result<StartState> start_state(const StateWish& wish);

/// "hub-1-tcp-127.0.0.1-7450", or "" for an address whose port the system chooses.
[[nodiscard]] std::string state_folder_name(HubId hub, const ListenUrl& address);

}  // namespace gimnet::hub
