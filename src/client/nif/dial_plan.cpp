#include "client/nif/dial_plan.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "base/clock.hpp"

namespace gimnet::nif {

void DialPlan::admitted(const std::string& url) {
  hub_ends_ = false;
  const auto there = std::ranges::find(addresses_, url, &net::Address::url);
  if (there != addresses_.end()) std::rotate(addresses_.begin(), there, addresses_.end());
}

bool DialPlan::may_resume(proto::GoodbyeCode code, const SessionTerms& session) const {
  const bool kept = code == proto::GoodbyeCode::done || code == proto::GoodbyeCode::silent ||
                    code == proto::GoodbyeCode::slow_consumer ||
                    code == proto::GoodbyeCode::stalled_frame;
  return dials_to_resume_ && session.resume && session.grace_ns > 0 && kept;
}

std::optional<Failure> DialPlan::broke(const std::string& why, proto::GoodbyeCode code,
                                       const SessionTerms& session, std::int64_t now_ns) {
  resumes_only_ = may_resume(code, session);
  hub_ends_ = code == proto::GoodbyeCode::draining;
  broke_ns_ = now_ns;
  grace_ns_ = session.grace_ns;
  switch (code) {
    case proto::GoodbyeCode::replaced:
      return Failure{NIF_REPLACED, why + "; end the other program, or connect under another name"};
    case proto::GoodbyeCode::kicked:
      return Failure{NIF_REFUSED, why};
    case proto::GoodbyeCode::renumbered:
      return std::nullopt;  // not told to go: it comes back whatever else it does at a break
    default:
      if (reconnect_ || resumes_only_) return std::nullopt;
      return Failure{NIF_NOT_CONNECTED, why};
  }
}

std::span<const net::Address> DialPlan::addresses(std::int64_t now_ns) const {
  const bool may_be_back = !hub_ends_ && now_ns - broke_ns_ < kFormerHubNs;
  const std::size_t most = resumes_only_ || may_be_back ? 1 : addresses_.size();
  return std::span(addresses_).first(std::min(most, addresses_.size()));
}

Deadline DialPlan::deadline(std::int64_t now_ns) const {
  const Deadline whole = now_ns + kTryNs;
  return resumes_only_ ? std::min(whole, broke_ns_ + grace_ns_) : whole;
}

bool DialPlan::dials_again(const Failure& failure, std::int64_t now_ns) const {
  if (failure.status == NIF_REPLACED) return false;
  // A node that dials only because it was given another id (`renumbered`) has one try.
  if (!resumes_only_) return reconnect_;
  // A session that a hub keeps is gone with its process.
  return !failure.nobody_listens && now_ns - broke_ns_ < grace_ns_;
}

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
