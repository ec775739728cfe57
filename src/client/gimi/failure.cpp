#include "client/gimi/failure.hpp"

#include <array>
#include <cstddef>
#include <cstring>

#include "client/nif/error.hpp"

namespace gimnet::gimi {
namespace {

// Not NIF's sentence: calls of NIF inside one that succeeds may change that.
thread_local constinit std::array<char, GIMI_ERROR_BYTES_MAX + 1> t_sentence{};

constexpr std::array<const char*, 26> kStatusTexts{
    "done",         "timeout",       "closed",      "bad argument",   "no hub",
    "unknown host", "not connected", "bad version", "name taken",     "bad name",
    "refused",      "not found",     "taken",       "denied",         "limit reached",
    "too large",    "not delivered", "window full", "protocol error", "system error",
    "forked",       "not retained",  "busy",        "failed",         "gone",
    "silence"};

constexpr std::array<const char*, 11> kChangeTexts{
    "snapshot begins", "present", "snapshot ends", "joined",   "left", "away", "back",
    "renamed",         "changed", "advertised",    "withdrawn"};

}  // namespace

gimi_status fail(gimi_status status, std::string_view sentence) {
  const std::string_view kept = nif::cut_text(sentence, GIMI_ERROR_BYTES_MAX);
  std::memmove(t_sentence.data(), kept.data(), kept.size());
  t_sentence[kept.size()] = '\0';
  return status;
}

}  // namespace gimnet::gimi

extern "C" const char* gimi_error_text(void) { return gimnet::gimi::t_sentence.data(); }

extern "C" const char* gimi_status_text(gimi_status status) {
  using gimnet::gimi::kStatusTexts;
  switch (status) {
    case GIMI_NOT_TRUSTED:
      return "not trusted";
    case GIMI_NO_RIGHT:
      return "no right";
    case GIMI_EXPIRED:
      return "expired";
    default:
      break;
  }
  const auto index = static_cast<std::size_t>(status);
  return index < kStatusTexts.size() ? kStatusTexts[index] : "unknown status";
}

extern "C" const char* gimi_change_text(gimi_change change) {
  using gimnet::gimi::kChangeTexts;
  if (change == GIMI_WATCH_ENDED) return "ended";
  const auto index = static_cast<std::size_t>(change);
  return index < kChangeTexts.size() ? kChangeTexts[index] : "unknown";
}
