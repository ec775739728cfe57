#pragma once

#include <sys/socket.h>

#include <string>
#include <string_view>

#include "base/result.hpp"

namespace gimnet::impair {

/// A socket address as the system takes it.
struct Address {
  sockaddr_storage bytes{};
  socklen_t size = 0;

  [[nodiscard]] const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&bytes); }
};

/// A sentence about an address that is neither tcp://HOST:PORT nor unix:PATH; "" if it is one.
[[nodiscard]] std::string wrong_form_of(std::string_view url);

/// The first address of the host, which is looked up; waits for that. Errors: a sentence that names
/// the address. Thread safety: any thread.
[[nodiscard]] Result<Address> find_address(std::string_view url);

}  // namespace gimnet::impair
