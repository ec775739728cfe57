#include "client/nif/session_terms.hpp"

#include <algorithm>
#include <utility>

#include "base/ids.hpp"
#include "proto/frame/frame_header.hpp"

namespace gimnet::nif {
namespace {

/// Smaller frames than this no hub has reason to ask for; LIST ids and extensions need room.
constexpr std::uint32_t kFrameLengthMin = 16 * 1024;
constexpr std::uint32_t kKeepAliveMsDefault = 1'000;
constexpr std::uint32_t kSilentMsDefault = 3'000;
constexpr std::uint32_t kKeepAliveMsMin = 10;
constexpr std::uint32_t kKeepAliveMsMax = 60'000;

Failure bad_welcome(const char* fault) {
  return {NIF_PROTOCOL, std::string("the hub's WELCOME ") + fault};
}

std::int64_t milliseconds(std::uint32_t value, std::uint32_t fallback) {
  return std::clamp(value == 0 ? fallback : value, kKeepAliveMsMin, kKeepAliveMsMax) * kNsPerMs;
}

}  // namespace

Result<SessionTerms, Failure> session_terms_of(const proto::Welcome& welcome, bool resume,
                                               std::uint64_t former_hub_epoch) {
  const std::uint32_t index = index_of(welcome.node);
  const HubId hub = hub_of(welcome.node);
  if (index == kHubIndex || index == kEveryIndex || hub == kOwnHub || hub == kEveryHub ||
      hub != welcome.hub) {
    return bad_welcome("gives an impossible node id");
  }
  if (welcome.token.empty() || welcome.token.size() > proto::kTokenBytesMax) {
    return bad_welcome("has no token");
  }
  if (welcome.frame_length_max < kFrameLengthMin) {
    return bad_welcome("allows only frames smaller than 16 KiB");
  }
  SessionTerms session;
  session.id = welcome.node.value();
  session.hub_id = welcome.hub.value();
  session.hub_name = welcome.hub_name;
  session.name = welcome.name;
  session.token = welcome.token;
  session.hub_epoch = welcome.epoch;
  session.frame_bytes_max = std::min(welcome.frame_length_max, proto::kFrameLengthDefault);
  session.keep_alive_ns = milliseconds(welcome.keep_alive_ms, kKeepAliveMsDefault);
  session.silent_after_ns =
      std::max(milliseconds(welcome.silent_ms, kSilentMsDefault), session.keep_alive_ns * 2);
  session.grace_ns = std::int64_t{welcome.grace_ms} * kNsPerMs;
  session.hub_time_ns = welcome.hub_time_ns;
  session.retained_bytes_max = welcome.retained_bytes_max;
  session.resume = resume && welcome.resume_buffer_bytes > 0;
  session.resumed = session.resume && welcome.resumed && former_hub_epoch != 0;
  if (session.resumed && welcome.epoch != former_hub_epoch) {
    return bad_welcome("resumes another epoch than the one asked for");
  }
  session.hub_taken = session.resumed ? welcome.taken : 0;
  session.hub_resume_bytes = welcome.resume_buffer_bytes;
  session.takes_missed = (welcome.features & proto::kFeatureMissed) != 0;
  if (!welcome.last_goodbye_sentence.empty()) {
    const auto code = static_cast<proto::GoodbyeCode>(welcome.last_goodbye_code);
    session.earlier_goodbye = proto::goodbye_name(code) + (": " + welcome.last_goodbye_sentence);
  }
  return session;
}

}  // namespace gimnet::nif
