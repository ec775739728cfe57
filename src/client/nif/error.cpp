#include "client/nif/error.hpp"

#include <array>
#include <cstring>

#include "base/cut_text.hpp"

namespace gimnet::nif {
namespace {

thread_local constinit std::array<char, NIF_SENTENCE_BYTES_MAX + 1> t_sentence{};

constexpr std::array<const char*, 28> kTexts{
    "done",           "timeout",       "closed",      "bad argument", "no hub",
    "not connected",  "bad version",   "name taken",  "bad name",     "hub full",
    "refused",        "replaced",      "not found",   "taken",        "denied",
    "limit reached",  "not supported", "bad request", "too large",    "not delivered",
    "protocol error", "out of memory", "in callback", "forked",       "buffer too small",
    "system error",   "unknown host",  "not retained"};

}  // namespace

nif_status fail(nif_status status, std::string_view sentence) {
  const std::string_view kept = cut_text(sentence, NIF_SENTENCE_BYTES_MAX);
  std::memmove(t_sentence.data(), kept.data(), kept.size());  // it may be said again
  t_sentence[kept.size()] = '\0';
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
