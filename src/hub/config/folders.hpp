#pragma once

#include <string>
#include <vector>

#include "base/result.hpp"

namespace gimnet::hub {

/// Creates the folder with mode 0700 where there is none. "" or why it cannot be used: it is no
/// folder, belongs to another user, others have rights in it, or nothing can be put into it.
[[nodiscard]] std::string prepare_private_folder(const std::string& path);

/// The user's folder for sockets of this network, runtime_folder_of_user(), made ready. Errors: as
/// prepare_private_folder().
[[nodiscard]] Result<std::string> runtime_folder();

/// The addresses of a hub that is told none: loopback, and a Unix socket in the runtime folder.
/// Nothing is made.
[[nodiscard]] std::vector<std::string> default_addresses();

/// The folder for what a hub keeps, created with mode 0700. "" or why it cannot be used: it is no
/// folder, belongs to another user, others may write to it, or this user may not.
[[nodiscard]] std::string prepare_state_folder(const std::string& path);

/// The default place of the state of the hub of that name: `name` in STATE_DIRECTORY (systemd),
/// else in gimnet in XDG_STATE_HOME, else in ~/.local/state/gimnet. The folders above it are
/// created. Errors: why there is no such place; root takes none in the home of another user.
[[nodiscard]] Result<std::string> default_state_folder(const std::string& name);

}  // namespace gimnet::hub
