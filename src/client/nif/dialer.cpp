#include "client/nif/dialer.hpp"

#include <cstddef>
#include <cstdint>
#include <utility>

#include "base/clock.hpp"

namespace gimnet::nif {
namespace {

Result<Admitted, Failure> admit_at(const net::Address& address, const net::DialOptions& options,
                                   proto::Hello hello, Deadline deadline,
                                   const net::WakeSignal& cancel, const TokenFor& token_for) {
  if (hello.token.empty() && token_for) hello.token = token_for(address.url());
  auto welcomed = net::dial_hub(address, options, hello, deadline, cancel);
  if (!welcomed) return failure_of(welcomed.error());
  auto session = session_terms_of(welcomed->welcome, hello.resume, hello.resume_epoch);
  if (!session) {
    return Failure{session.error().status, address.url() + ": " + session.error().sentence};
  }
  return Admitted{std::move(welcomed->stream), address.url(), std::move(*session)};
}

}  // namespace

Result<Admitted, Failure> admit(std::span<const net::Address> addresses,
                                const net::DialOptions& options, const proto::Hello& hello,
                                Deadline deadline, const net::WakeSignal& cancel,
                                const TokenFor& token_for) {
  Failure last{NIF_NO_HUB, "no address to connect to"};
  for (std::size_t i = 0; i < addresses.size(); ++i) {
    // One that never answers leaves the others their share of the time.
    const auto left = static_cast<std::int64_t>(addresses.size() - i);
    const std::int64_t now = steady_now_ns();
    const Deadline until = deadline == kNever ? kNever : now + (deadline - now) / left;
    auto admitted = admit_at(addresses[i], options, hello, until, cancel, token_for);
    if (admitted || !admitted.error().other_hubs_may) return admitted;
    last = admitted.error();
  }
  return last;
}

}  // namespace gimnet::nif
