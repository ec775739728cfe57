#include "hub/control/listen_url.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>

#include <algorithm>
#include <charconv>

#include "base/log.hpp"

namespace gimnet::hub {
namespace {

constexpr std::size_t kQuotedLineMax = 120;

Error refuse(std::string_view text, std::string_view why) {
  return Error{"cannot listen on " + escaped(text, kQuotedLineMax) + ": " + std::string{why}};
}

constexpr std::string_view kForms =
    "write tcp://127.0.0.1:7450, tcp://[::1]:7450 or unix:/path/to/socket";

/// The system's functions would read only what stands before it.
bool has_zero(const std::string& host) { return host.find('\0') != std::string::npos; }

bool is_v4(const std::string& host) {
  in_addr address{};
  return !has_zero(host) && ::inet_pton(AF_INET, host.c_str(), &address) == 1;
}
bool is_v6(const std::string& host) {
  in6_addr address{};
  return !has_zero(host) && ::inet_pton(AF_INET6, host.c_str(), &address) == 1;
}

Result<ListenUrl> parse_tcp(std::string_view text, std::string_view rest) {
  const std::size_t colon = rest.rfind(':');
  const bool bracketed = !rest.empty() && rest.front() == '[';
  if (colon == std::string_view::npos || (bracketed && (colon == 0 || rest[colon - 1] != ']'))) {
    return refuse(text, "the port is missing; " + std::string{kForms});
  }
  ListenUrl url;
  const std::string_view port = rest.substr(colon + 1);
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), url.port);
  if (port.empty() || error != std::errc{} || end != port.data() + port.size()) {
    return refuse(text, "the port must be 0 (any free one) to 65535");
  }
  url.host = std::string{bracketed ? rest.substr(1, colon - 2) : rest.substr(0, colon)};
  if (url.host == "localhost") url.host = "127.0.0.1";
  if (bracketed ? !is_v6(url.host) : !is_v4(url.host)) {
    return refuse(text, "'" + escaped(url.host, kQuotedLineMax) + "' is not a numeric address; " +
                            std::string{kForms});
  }
  return url;
}

Result<ListenUrl> parse_unix(std::string_view text, std::string_view rest) {
  if (rest.starts_with("//")) rest.remove_prefix(2);  // unix:///path is unix:/path
  if (rest.empty() || rest.front() != '/')
    return refuse(text, "the path must be absolute, as in unix:/run/tcphub.sock");
  if (rest.size() > kSocketPathMax) {
    return refuse(text, "the path has " + std::to_string(rest.size()) +
                            " bytes, and a socket's may have " + std::to_string(kSocketPathMax) +
                            "; choose a shorter one");
  }
  // Addresses are printed side by side, and in lines of the log.
  if (std::ranges::any_of(rest, [](unsigned char c) { return c <= ' ' || c == 0x7f; })) {
    return refuse(text, "the path must not contain spaces or control characters");
  }
  ListenUrl url;
  url.scheme = ListenUrl::Scheme::unix_socket;
  url.path = std::string{rest};
  return url;
}

}  // namespace

std::string ListenUrl::text() const {
  if (scheme == Scheme::unix_socket) return "unix:" + path;
  const bool v6 = host.find(':') != std::string::npos;
  return "tcp://" + (v6 ? "[" + host + "]" : host) + ":" + std::to_string(port);
}

bool ListenUrl::is_local() const {
  return scheme == Scheme::unix_socket || host == "::1" ||
         (host.starts_with("127.") && is_v4(host));
}

Result<ListenUrl> parse_listen_url(std::string_view text) {
  if (text.starts_with("tcp://")) return parse_tcp(text, text.substr(6));
  if (text.starts_with("unix:")) return parse_unix(text, text.substr(5));
  return refuse(text, kForms);
}

}  // namespace gimnet::hub
