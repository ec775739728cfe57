#pragma once

#include <csignal>
#include <cstdint>

#include "gimnet/gimi/outcome.hpp"

namespace gimnet::tool {

/// The end of the program; scripts rely on the numbers. A signal gives 128 and its number.
enum class ExitCode : std::uint8_t {
  done = 0,
  failed = 1,
  usage = 2,
  no_connection = 3,
  not_found = 4,
  timeout = 5,
  denied = 6,
  bad_version = 7,
  hung_up = 129,
  interrupted = 130,
  terminated = 143,
};

[[nodiscard]] constexpr ExitCode exit_code_of(Status status) {
  switch (status) {
    case Status::bad_argument:
    case Status::bad_name:
      return ExitCode::usage;
    case Status::no_hub:
    case Status::no_host:
    case Status::not_connected:
    case Status::refused:
      return ExitCode::no_connection;
    case Status::not_found:
      return ExitCode::not_found;
    case Status::timeout:
      return ExitCode::timeout;
    case Status::denied:
    case Status::name_taken:
      return ExitCode::denied;
    case Status::bad_version:
      return ExitCode::bad_version;
    default:
      return ExitCode::failed;
  }
}

/// `signal`: one that asks the program to stop.
[[nodiscard]] constexpr ExitCode exit_code_of_signal(int signal) {
  if (signal == SIGHUP) return ExitCode::hung_up;
  return signal == SIGTERM ? ExitCode::terminated : ExitCode::interrupted;
}

}  // namespace gimnet::tool
