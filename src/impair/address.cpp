#include "impair/address.hpp"

#include <netdb.h>
#include <sys/un.h>

#include <algorithm>
#include <cstddef>
#include <cstring>

namespace gimnet::impair {
namespace {

constexpr std::string_view kUnix = "unix:";
constexpr std::string_view kTcp = "tcp://";

Result<Address> unix_address(std::string_view path) {
  Address address;
  auto& name = reinterpret_cast<sockaddr_un&>(address.bytes);
  name.sun_family = AF_UNIX;
  std::ranges::copy(path, name.sun_path);
  address.size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + path.size() + 1);
  return address;
}

}  // namespace

std::string wrong_form_of(std::string_view url) {
  const std::string remedy = ": write tcp://HOST:PORT or unix:PATH";
  const std::string named = "'" + std::string(url) + "' ";
  if (url.starts_with(kUnix)) {
    if (url.size() == kUnix.size()) return named + "has no path" + remedy;
    const bool fits = url.size() - kUnix.size() < sizeof(sockaddr_un::sun_path);
    return fits ? "" : named + "has too long a path: 107 bytes are the most";
  }
  if (!url.starts_with(kTcp)) return named + "is no address" + remedy;
  const std::string_view rest = url.substr(kTcp.size());
  const std::size_t colon = rest.rfind(':');
  const bool whole = colon != std::string_view::npos && colon != 0 && colon + 1 != rest.size();
  return whole ? "" : named + "lacks the host or the port" + remedy;
}

Result<Address> find_address(std::string_view url) {
  if (const std::string wrong = wrong_form_of(url); !wrong.empty()) return Error{wrong};
  if (url.starts_with(kUnix)) return unix_address(url.substr(kUnix.size()));
  const std::size_t colon = url.rfind(':');
  std::string host(url.substr(kTcp.size(), colon - kTcp.size()));
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_NUMERICSERV;
  addrinfo* found = nullptr;
  const std::string port(url.substr(colon + 1));
  if (const int error = ::getaddrinfo(host.c_str(), port.c_str(), &hints, &found); error != 0)
    return Error{"'" + std::string(url) + "' cannot be found: " + ::gai_strerror(error)};
  Address address;
  address.size = found->ai_addrlen;
  std::memcpy(&address.bytes, found->ai_addr, found->ai_addrlen);
  ::freeaddrinfo(found);
  return address;
}

}  // namespace gimnet::impair
