#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "client/nif/error.hpp"
#include "net/address.hpp"
#include "net/proxy_address.hpp"

namespace gimnet::nif {

inline constexpr std::size_t kHubsMax = 16;

/// The addresses to try, in this order: those of `url` if not empty, separated by commas, else
/// those of GIMNET_HUB of the environment, else the user's default Unix socket (left out where its
/// folder is missing or another user's) and then tcp://127.0.0.1:7450. Errors: NIF_BAD_ARGUMENT.
[[nodiscard]] Result<std::vector<net::Address>, Failure> hub_addresses(std::string_view url);

/// The proxy to dial the hub through: `proxy`, or GIMNET_PROXY of the environment if that is null.
/// The environment's is left out where no `url` and no GIMNET_HUB names a hub by tcp://. `url`: as
/// above. Errors: NIF_BAD_ARGUMENT.
[[nodiscard]] Result<std::optional<net::ProxyAddress>, Failure> proxy_to_hub(const char* proxy,
                                                                             std::string_view url);

}  // namespace gimnet::nif
