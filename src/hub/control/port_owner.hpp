#pragma once

#include <sys/types.h>

#include <cstdint>
#include <string>

namespace gimnet::hub {

/// "tcphub (process 77)" for whoever listens on that TCP port of this machine, or "" if that is not
/// to be found out: another user's processes keep their descriptors to themselves. Reads /proc.
[[nodiscard]] std::string port_owner(std::uint16_t port);

/// "tcphub (process 77)", or "process 77" if its name is not to be had.
[[nodiscard]] std::string process_text(pid_t process);

}  // namespace gimnet::hub
