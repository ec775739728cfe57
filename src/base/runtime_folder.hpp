#pragma once

#include <string>

namespace gimnet {

/// The place of one user's sockets and tokens. Hub and library look at the same place, because both
/// ask here.
struct RuntimeFolder {
  std::string above;  ///< an absolute path
  std::string name;   ///< of the folder in it
  bool in_private =
      false;  ///< `above` is XDG_RUNTIME_DIR, the user's own; else anybody may make folders there
  [[nodiscard]] std::string path() const { return above + "/" + name; }
};

/// The runtime folder of the user as whom the process acts: `gimnet` in XDG_RUNTIME_DIR, else
/// gimnet-<uid> in TMPDIR, else in /tmp. A variable that is no absolute path counts as not set, as
/// the XDG Base Directory Specification says: else the place would change with the folder in which
/// a program was started. Nothing is made or looked at.
[[nodiscard]] RuntimeFolder runtime_folder_of_user();

}  // namespace gimnet
