#include "net/proxy_address.hpp"

#include <algorithm>
#include <charconv>
#include <optional>

namespace gimnet::net {
namespace {

constexpr std::string_view kHttp = "http://";

bool is_control(unsigned char byte) { return byte < 0x20 || byte == 0x7f; }

Error refuse(std::string_view url, std::string_view why) {
  return Error{"cannot use the proxy '" + shown_proxy(url) + "': " + std::string(why) +
               "; write http://HOST:PORT or http://USER:PASSWORD@HOST:PORT"};
}

/// Nothing: a % without two hexadecimal digits, or the code of a control character.
std::optional<std::string> decoded(std::string_view text) {
  std::string plain;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned char byte = static_cast<unsigned char>(text[i]);
    if (byte == '%') {
      const std::string_view digits = text.substr(i + 1, 2);
      const auto [end, error] =
          std::from_chars(digits.data(), digits.data() + digits.size(), byte, 16);
      if (error != std::errc{} || digits.size() != 2 || end != digits.data() + 2)
        return std::nullopt;
      i += 2;
    }
    if (is_control(byte)) return std::nullopt;
    plain += static_cast<char>(byte);
  }
  return plain;
}

}  // namespace

std::string ProxyAddress::shown() const {
  const std::string login = password.empty() ? user : user + ":***";
  return std::string(kHttp) + login + (login.empty() ? "" : "@") + place();
}

std::string ProxyAddress::place() const {
  const bool numeric_v6 = host.find(':') != std::string::npos;
  return (numeric_v6 ? "[" + host + "]" : host) + ":" + std::to_string(port);
}

Result<ProxyAddress> proxy_towards(const Address& hub, std::string_view url) {
  if (hub.scheme == Address::Scheme::tcp) return parse_proxy(url);
  return Error{"no proxy reaches " + hub.url() +
               ", a socket of this machine: leave the proxy out, or give a tcp:// URL"};
}

Result<ProxyAddress> parse_proxy(std::string_view url) {
  if (std::ranges::any_of(url, is_control))
    return refuse("...", "there are control characters in its URL");
  if (!url.starts_with(kHttp)) return refuse(url, "its URL does not begin with http://");
  std::string_view rest = url.substr(kHttp.size());
  if (rest.ends_with('/')) rest.remove_suffix(1);
  ProxyAddress proxy;
  if (const std::size_t at = rest.rfind('@'); at != std::string_view::npos) {
    const std::string_view login = rest.substr(0, at);
    const std::size_t colon = login.find(':');
    const auto user = decoded(login.substr(0, colon));
    const auto password =
        decoded(colon == std::string_view::npos ? std::string_view{} : login.substr(colon + 1));
    if (!user || !password || user->empty() || user->find(':') != std::string::npos)
      return refuse(url, "user or password is wrong (%XX stands for a special character)");
    proxy.user = *user;
    proxy.password = *password;
    rest.remove_prefix(at + 1);
  }
  const std::size_t colon = rest.rfind(':');
  const bool bracketed = rest.starts_with('[');
  if (colon == std::string_view::npos || (bracketed && (colon < 2 || rest[colon - 1] != ']')))
    return refuse(url, "the port is missing");
  proxy.host = bracketed ? rest.substr(1, colon - 2) : rest.substr(0, colon);
  const bool plain = proxy.host.find_first_not_of(
                         "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789.-_:%") ==
                     std::string::npos;
  if (proxy.host.empty() || !plain || (!bracketed && proxy.host.find(':') != std::string::npos))
    return refuse(url, "its host is not understood");
  const std::string_view port = rest.substr(colon + 1);
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), proxy.port);
  if (error != std::errc{} || end != port.data() + port.size() || proxy.port == 0)
    return refuse(url, "the port is not a number from 1 to 65535");
  return proxy;
}

std::string shown_proxy(std::string_view url) {
  const std::size_t at = url.rfind('@');
  if (at == std::string_view::npos) return std::string(url);
  const std::size_t scheme = url.find("://");
  const std::size_t login = scheme == std::string_view::npos || scheme > at ? 0 : scheme + 3;
  const std::size_t colon = url.find(':', login);
  if (colon > at) return std::string(url);  // a user alone
  return std::string(url.substr(0, colon)) + ":***" + std::string(url.substr(at));
}

}  // namespace gimnet::net
