#include "client/nif/error.hpp"

#include <array>
#include <cstring>

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

/// The meaning of a GOODBYE for nif_connect().
nif_status status_of(proto::GoodbyeCode code) {
  switch (code) {
    case proto::GoodbyeCode::bad_version:
      return NIF_BAD_VERSION;
    case proto::GoodbyeCode::name_taken:
      return NIF_NAME_TAKEN;
    case proto::GoodbyeCode::bad_name:
      return NIF_BAD_NAME;
    case proto::GoodbyeCode::hub_full:
    case proto::GoodbyeCode::no_memory:
      return NIF_HUB_FULL;
    case proto::GoodbyeCode::not_allowed:
      return NIF_DENIED;
    case proto::GoodbyeCode::replaced:
      return NIF_REPLACED;
    default:
      return NIF_REFUSED;
  }
}

nif_status status_of(const net::NetError& error) {
  switch (error.fault) {
    case net::Fault::bad_address:
      return NIF_BAD_ARGUMENT;
    case net::Fault::no_host:
      return NIF_NO_HOST;
    case net::Fault::no_peer:
      return NIF_NO_HUB;
    case net::Fault::not_permitted:
      return NIF_SYSTEM;
    case net::Fault::no_memory:
      return NIF_NO_MEMORY;
    case net::Fault::timeout:
      return NIF_TIMEOUT;
    case net::Fault::cancelled:
      return NIF_CLOSED;
    case net::Fault::bad_version:
      return NIF_BAD_VERSION;
    case net::Fault::refused:
      return status_of(error.goodbye);
    case net::Fault::protocol:
      break;
  }
  return NIF_PROTOCOL;
}

bool other_hubs_may(const net::NetError& error) {
  switch (error.fault) {
    case net::Fault::no_host:
    case net::Fault::no_peer:
    case net::Fault::timeout:
      return true;
    case net::Fault::refused:
      return error.goodbye == proto::GoodbyeCode::hub_full ||
             error.goodbye == proto::GoodbyeCode::no_memory ||
             error.goodbye == proto::GoodbyeCode::draining;
    default:
      return false;
  }
}

}  // namespace

Failure failure_of(const net::NetError& error) {
  return {status_of(error), error.sentence, error.nobody_listens, other_hubs_may(error)};
}

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
