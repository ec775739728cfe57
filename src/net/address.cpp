#include "net/address.hpp"

#include <algorithm>
#include <charconv>

namespace gimnet::net {
namespace {

constexpr std::string_view kTcpScheme = "tcp://";
constexpr std::string_view kUnix = "unix:";

bool is_host(std::string_view text) {
  constexpr std::string_view kLetters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789.-";
  return !text.empty() && text.find_first_not_of(kLetters) == std::string_view::npos;
}

/// Guesses at an address without its scheme or its port.
std::string advice_for(std::string_view url) {
  std::string meant;
  if (url.starts_with('/')) meant = std::string(kUnix) + std::string(url);
  if (url.find('/') == std::string_view::npos && url.find(':') != std::string_view::npos) {
    meant = std::string(kTcpScheme) + std::string(url);
  }
  // A slash too few, or too many.
  constexpr std::string_view kScheme = "tcp:/";
  if (url.starts_with(kScheme)) {
    meant =
        std::string(kTcpScheme) +
        std::string(url.substr(std::min(url.find_first_not_of('/', kScheme.size()), url.size())));
  }
  if (!meant.empty() && meant != url && parse_address(meant)) return "did you mean " + meant + "?";
  std::string advice = "give tcp://host:port or unix:/path";
  const std::string_view host = url.starts_with(kTcpScheme) ? url.substr(kTcpScheme.size()) : url;
  if (is_host(host)) {
    advice += ", such as " + std::string(kTcpScheme) + std::string(host) + ":" +
              std::to_string(kDefaultPort);
  }
  return advice;
}

NetError not_understood(std::string_view url, std::string_view why) {
  return {Fault::bad_address, "cannot use the hub URL '" + std::string(url) +
                                  "': " + std::string(why) + "; " + advice_for(url)};
}

}  // namespace

std::string Address::url() const {
  if (scheme == Scheme::unix_socket) return std::string(kUnix) + path;
  const bool numeric_v6 = host.find(':') != std::string::npos;
  return std::string(kTcpScheme) + (numeric_v6 ? "[" + host + "]" : host) + ":" +
         std::to_string(port);
}

Result<Address, NetError> parse_address(std::string_view url, std::uint16_t least_port) {
  Address address;
  if (url.starts_with(kUnix)) {
    address.scheme = Address::Scheme::unix_socket;
    address.path = url.substr(kUnix.size());
    if (address.path.empty()) return not_understood(url, "the path is missing");
    if (address.path.size() > kSocketPathMax)
      return not_understood(url, "the path is too long for a Unix socket");
    return address;
  }
  if (!url.starts_with(kTcpScheme)) return not_understood(url, "the scheme is unknown");
  const std::string_view rest = url.substr(kTcpScheme.size());
  const std::size_t colon = rest.rfind(':');
  if (colon == std::string_view::npos) return not_understood(url, "the port is missing");
  std::string_view host = rest.substr(0, colon);
  if (host.size() >= 2 && host.front() == '[' && host.back() == ']')
    host = host.substr(1, host.size() - 2);
  if (host.empty()) return not_understood(url, "the host is missing");
  // A proxy is told it in a line of text.
  const auto unprintable = [](unsigned char c) { return c <= ' ' || c == 0x7f; };
  if (std::ranges::any_of(host, unprintable))
    return not_understood(url, "the host has blanks or control characters");
  if (host.find_first_of("[]") != std::string_view::npos) {
    return not_understood(url, "an IPv6 address stands between [ and ]");
  }
  const std::string_view port = rest.substr(colon + 1);
  const auto parsed = std::from_chars(port.data(), port.data() + port.size(), address.port);
  if (parsed.ec != std::errc() || parsed.ptr != port.data() + port.size() ||
      address.port < least_port) {
    return not_understood(
        url, "the port is not a number from " + std::to_string(least_port) + " to 65535");
  }
  address.host = host;
  return address;
}

}  // namespace gimnet::net
