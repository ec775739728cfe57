#pragma once

#include <string>
#include <string_view>

#include "net/address.hpp"
#include "net/host_lookup.hpp"
#include "net/wait.hpp"

// Sockets of the measuring programs. Every failure ends the program with a sentence: a measurement
// that cannot be made has no result. Thread safety: none; one thread.

namespace gimnet::perf {

/// Prints `program: what: reason` on standard error and exits with 1. With `error` 0 the reason is
/// left out.
[[noreturn]] void fail(std::string_view what, int error = 0);

// Addresses are as the hub prints them: `tcp://127.0.0.1:7450` or `unix:/path`.

/// Ends the program when it is none.
[[nodiscard]] gimnet::net::HostAddress address_of(const std::string& url);
/// A connected, non-blocking socket with TCP_NODELAY.
[[nodiscard]] int connect_to(const gimnet::net::HostAddress& address);
/// A listening, non-blocking socket with the longest backlog that the system allows.
[[nodiscard]] int listen_on(const std::string& url);
/// The address that a listening socket really has.
[[nodiscard]] std::string local_url(int listener, const std::string& url);
/// Sets TCP_NODELAY if the socket is TCP, and SO_SNDBUF unless `send_buffer_bytes` is 0.
void tune(int socket, int send_buffer_bytes);
/// Lets this process hold as many descriptors as its hard limit allows.
void raise_descriptor_limit();

}  // namespace gimnet::perf
