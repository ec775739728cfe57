#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/ids.hpp"
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

}  // namespace gimnet::hub
