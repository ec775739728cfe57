#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/ids.hpp"
#include "base/result.hpp"
#include "net/address.hpp"

namespace gimnet::hub {

inline constexpr std::uint32_t kLinkKeepAliveMs = 250;
inline constexpr std::uint32_t kLinkSilentMs = 1'000;

/// Terms of a link that either end decides for itself. A value type.
struct LinkTerms {
  std::uint32_t keep_alive_ms = kLinkKeepAliveMs;  ///< the larger of both ends counts
  std::uint32_t silent_ms = kLinkSilentMs;         ///< the same
  /// The hubs that data frames from this link may name as their source's. Empty: all but this one.
  std::vector<HubId> allow{};
  friend bool operator==(const LinkTerms&, const LinkTerms&) = default;
};

/// A link that this hub dials: `--link URL`, or a table `[[link]]` of the configuration.
struct DialledLink {
  net::Address address;
  std::string name;        ///< 1..255 bytes; the URL if nobody gave another one
  std::uint16_t cost = 0;  ///< 1..65,535; 0: measured
  std::string proxy{};     ///< `http://host:port` to dial through; "": none
  LinkTerms terms{};
  friend bool operator==(const DialledLink&, const DialledLink&) = default;
};

/// A hub's links as it is configured: `[[link]]` and `[links]`. A value type.
struct LinksOptions {
  bool accept = false;   ///< `--accept-links`
  LinkTerms accepted{};  ///< of links that others dial
  std::vector<DialledLink> dial{};
};

/// Dialled links of one hub.
inline constexpr std::size_t kDialledLinksMax = 4'093;

/// Names of links, which other hubs give too, are printed side by side and in lines of the log: 1
/// to 255 bytes of UTF-8 without spaces and control characters.
[[nodiscard]] bool is_link_name(std::string_view name);

/// A link to that URL. An empty name is the URL. Errors: a sentence that names what is wrong, and
/// says how to write it.
[[nodiscard]] Result<DialledLink> make_link(std::string_view url, std::string_view name);

/// Is it this machine for certain? True for Unix sockets, 127.0.0.0/8, ::1 and `localhost`.
[[nodiscard]] bool is_local(const net::Address& address);

/// Why a link to another machine is refused; `word` allows it.
[[nodiscard]] std::string not_encrypted(const net::Address& address, std::string_view word);

}  // namespace gimnet::hub
