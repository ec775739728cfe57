#include "client/nif/endpoint.hpp"

#include <algorithm>
#include <charconv>

#include "client/nif/platform.hpp"

namespace gimnet::nif {
namespace {

constexpr std::string_view kTcp = "tcp://";
constexpr std::string_view kUnix = "unix:";

bool is_host(std::string_view text) {
  constexpr std::string_view kLetters =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789.-";
  return !text.empty() && text.find_first_not_of(kLetters) == std::string_view::npos;
}

/// What was probably meant by an address without its scheme or its port.
std::string advice_for(std::string_view url) {
  std::string meant;
  if (url.starts_with('/')) meant = std::string(kUnix) + std::string(url);
  if (url.find('/') == std::string_view::npos && url.find(':') != std::string_view::npos) {
    meant = std::string(kTcp) + std::string(url);
  }
  // A slash too few, or too many.
  constexpr std::string_view kScheme = "tcp:/";
  if (url.starts_with(kScheme)) {
    meant =
        std::string(kTcp) +
        std::string(url.substr(std::min(url.find_first_not_of('/', kScheme.size()), url.size())));
  }
  if (!meant.empty() && meant != url && parse_endpoint(meant)) return "did you mean " + meant + "?";
  std::string advice = "give tcp://host:port or unix:/path";
  const std::string_view host = url.starts_with(kTcp) ? url.substr(kTcp.size()) : url;
  if (is_host(host)) {
    advice +=
        ", such as " + std::string(kTcp) + std::string(host) + ":" + std::to_string(kDefaultPort);
  }
  return advice;
}

Failure not_understood(std::string_view url, std::string_view why) {
  return {NIF_BAD_ARGUMENT, "cannot use the hub URL '" + std::string(url) +
                                "': " + std::string(why) + "; " + advice_for(url)};
}

}  // namespace

std::string Endpoint::url() const {
  if (transport == Transport::unix_socket) return std::string(kUnix) + path;
  const bool numeric_v6 = host.find(':') != std::string::npos;
  return std::string(kTcp) + (numeric_v6 ? "[" + host + "]" : host) + ":" + std::to_string(port);
}

Result<Endpoint, Failure> parse_endpoint(std::string_view url) {
  Endpoint endpoint;
  if (url.starts_with(kUnix)) {
    endpoint.transport = Endpoint::Transport::unix_socket;
    endpoint.path = url.substr(kUnix.size());
    if (endpoint.path.empty()) return not_understood(url, "the path is missing");
    if (endpoint.path.size() > unix_path_max())
      return not_understood(url, "the path is too long for a Unix socket");
    return endpoint;
  }
  if (!url.starts_with(kTcp)) return not_understood(url, "the scheme is unknown");
  const std::string_view rest = url.substr(kTcp.size());
  const std::size_t colon = rest.rfind(':');
  if (colon == std::string_view::npos) return not_understood(url, "the port is missing");
  std::string_view host = rest.substr(0, colon);
  if (host.size() >= 2 && host.front() == '[' && host.back() == ']')
    host = host.substr(1, host.size() - 2);
  if (host.empty()) return not_understood(url, "the host is missing");
  if (host.find_first_of("[]") != std::string_view::npos) {
    return not_understood(url, "an IPv6 address stands between [ and ]");
  }
  const std::string_view port = rest.substr(colon + 1);
  const auto parsed = std::from_chars(port.data(), port.data() + port.size(), endpoint.port);
  if (parsed.ec != std::errc() || parsed.ptr != port.data() + port.size() || endpoint.port == 0) {
    return not_understood(url, "the port is not a number from 1 to 65535");
  }
  endpoint.host = host;
  return endpoint;
}

Result<std::vector<Endpoint>, Failure> endpoints_for(std::string_view url) {
  const std::string chosen = url.empty() ? environment("GIMNET_HUB") : std::string(url);
  std::vector<Endpoint> endpoints;
  if (!chosen.empty()) {
    auto parsed = parse_endpoint(chosen);
    if (!parsed) {
      Failure failure = parsed.error();
      if (url.empty()) failure.sentence += " (that is GIMNET_HUB)";
      return failure;
    }
    endpoints.push_back(std::move(*parsed));
    return endpoints;
  }
  if (const std::string folder = runtime_folder(); !folder.empty()) {
    Endpoint local;
    local.transport = Endpoint::Transport::unix_socket;
    local.path = folder + "/tcphub.sock";
    if (local.path.size() <= unix_path_max()) endpoints.push_back(std::move(local));
  }
  Endpoint loopback;
  loopback.host = "127.0.0.1";
  loopback.port = kDefaultPort;
  endpoints.push_back(std::move(loopback));
  return endpoints;
}

}  // namespace gimnet::nif
