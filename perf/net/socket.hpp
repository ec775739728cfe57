#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

// Sockets of the measuring programs. Every failure ends the program with a sentence: a measurement
// that cannot be made has no result. Thread safety: none; one thread.

namespace gimnet::perf {

/// Prints `program: what: reason` on standard error and exits with 1. With `error` 0 the reason is
/// left out.
[[noreturn]] void fail(std::string_view what, int error = 0);

/// An address as the hub prints it: `tcp://127.0.0.1:7450` or `unix:/path`.
struct Endpoint {
  bool is_unix = false;
  std::string host_or_path;
  std::uint16_t port = 0;
};

/// Ends the program when `url` has neither form.
[[nodiscard]] Endpoint parse_endpoint(std::string_view url);

/// A connected, non-blocking socket with TCP_NODELAY.
[[nodiscard]] int connect_to(const Endpoint& endpoint);
/// A listening, non-blocking socket with the longest backlog that the system allows.
[[nodiscard]] int listen_on(const Endpoint& endpoint);
/// The address that a listening socket really has, as a URL.
[[nodiscard]] std::string local_url(int listener, const Endpoint& endpoint);
/// Sets TCP_NODELAY where the socket is TCP, and SO_SNDBUF unless `send_buffer_bytes` is 0.
void tune(int socket, const Endpoint& endpoint, int send_buffer_bytes);
/// Lets this process hold as many descriptors as its hard limit allows.
void raise_descriptor_limit();

}  // namespace gimnet::perf
