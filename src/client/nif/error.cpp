#include "client/nif/error.hpp"

#include <algorithm>
#include <array>
#include <cstring>

namespace gimnet::nif {
namespace {

constexpr std::size_t kSentenceMax = 512;
thread_local constinit std::array<char, kSentenceMax> t_sentence{};

constexpr std::array<const char*, 26> kTexts{
    "done",           "timeout",       "closed",      "bad argument", "no hub",
    "not connected",  "bad version",   "name taken",  "bad name",     "hub full",
    "refused",        "replaced",      "not found",   "taken",        "denied",
    "limit reached",  "not supported", "bad request", "too large",    "not delivered",
    "protocol error", "out of memory", "in callback", "forked",       "buffer too small",
    "system error"};

}  // namespace

nif_status fail(nif_status status, std::string_view sentence) {
  const std::size_t size = std::min(sentence.size(), kSentenceMax - 1);
  std::memcpy(t_sentence.data(), sentence.data(), size);
  t_sentence[size] = '\0';
  return status;
}

nif_status fail(const Failure& failure) { return fail(failure.status, failure.sentence); }

const char* error_text() { return t_sentence.data(); }

}  // namespace gimnet::nif

extern "C" const char* nif_status_text(nif_status status) {
  const auto index = static_cast<std::size_t>(status);
  return index < gimnet::nif::kTexts.size() ? gimnet::nif::kTexts[index] : "unknown status";
}

extern "C" const char* nif_error_text(void) { return gimnet::nif::error_text(); }
