// Any bytes as the payload of NS and CTRL frames: requests, answers and events. Input: a payload.

#include <cstddef>
#include <cstdint>
#include <span>

#include "fuzz/support/control_round_trip.hpp"
#include "proto/bitestream/reader.hpp"
#include "proto/control/ctrl_network.hpp"
#include "proto/control/ns_register.hpp"
#include "proto/control/ns_watch.hpp"

namespace {

using namespace gimnet;
using namespace gimnet::proto;
using Bytes = std::span<const std::byte>;

void check_requests(Bytes payload) {
  fuzz::check_message<ns::Resolve>(payload);
  fuzz::check_message<ns::Reverse>(payload);
  fuzz::check_message<ns::List>(payload);
  fuzz::check_message<ns::Advertise>(payload);
  fuzz::check_message<ns::Withdraw>(payload);
  fuzz::check_message<ns::ServicesRequest>(payload);
  fuzz::check_message<ns::Subscribe>(payload);
  fuzz::check_message<ns::Unsubscribe>(payload);
  fuzz::check_message<ns::ServiceMoved>(payload);
  fuzz::check_message<ns::Subscribers>(payload);
  fuzz::check_message<ns::RegisterName>(payload);
  fuzz::check_message<ns::UnregisterName>(payload);
  fuzz::check_message<ns::NameLost>(payload);
  fuzz::check_message<ns::Watch>(payload);
  fuzz::check_message<ns::Unwatch>(payload);
  fuzz::check_message<ns::WatchTaken>(payload);
  fuzz::check_message<ns::WatchEvents>(payload);
  fuzz::check_message<ctrl::HubInfo>(payload);
  fuzz::check_message<ctrl::Statistics>(payload);
  fuzz::check_message<ctrl::Connections>(payload);
  fuzz::check_message<ctrl::Kick>(payload);
  fuzz::check_message<ctrl::Reassign>(payload);
  fuzz::check_message<ctrl::Reload>(payload);
  fuzz::check_message<ctrl::SetLogLevel>(payload);
  fuzz::check_message<ctrl::Hubs>(payload);
  fuzz::check_message<ctrl::LinksRequest>(payload);
  fuzz::check_message<ctrl::LinkAdd>(payload);
  fuzz::check_message<ctrl::LinkRemove>(payload);
  fuzz::check_message<ctrl::SetLinkCost>(payload);
}

/// A list that was accepted has an id in each record.
void check_records(Bytes payload) {
  bitestream::Reader reader(payload.subspan(kControlHeaderSize));
  while (const auto value = reader.next()) {
    if (!(value->key() == bitestream::Key(3))) continue;
    const auto record = value->as_nested();
    FUZZ_MUST(record.has_value());
    const auto id = record->find(1);
    FUZZ_MUST(id && id->as<std::uint32_t>());
  }
}

void check_answers(Bytes payload) {
  fuzz::check_answer<ns::ResolveAnswer>(payload);
  fuzz::check_answer<ns::ReverseAnswer>(payload);
  fuzz::check_answer<ns::AdvertiseAnswer>(payload);
  fuzz::check_answer<ns::WithdrawAnswer>(payload);
  fuzz::check_answer<ns::SubscribeAnswer>(payload);
  fuzz::check_answer<ns::UnsubscribeAnswer>(payload);
  fuzz::check_answer<ns::RegisterNameAnswer>(payload);
  fuzz::check_answer<ns::UnregisterNameAnswer>(payload);
  fuzz::check_answer<ns::WatchAnswer>(payload);
  fuzz::check_answer<ns::UnwatchAnswer>(payload);
  fuzz::check_answer<ns::WatchTakenAnswer>(payload);
  fuzz::check_answer<ctrl::HubInfoAnswer>(payload);
  if (fuzz::check_answer<ns::ListAnswer>(payload)) check_records(payload);
  if (fuzz::check_answer<ns::ServicesAnswer>(payload)) check_records(payload);
  if (fuzz::check_answer<ctrl::StatisticsAnswer>(payload)) check_records(payload);
  if (fuzz::check_answer<ctrl::ConnectionsAnswer>(payload)) check_records(payload);
  if (fuzz::check_answer<ctrl::HubsAnswer>(payload)) check_records(payload);
  fuzz::check_answer<ctrl::LinksAnswer>(payload);
  if (fuzz::check_answer<ctrl::ReloadAnswer>(payload)) check_records(payload);
  fuzz::check_answer<ctrl::SetLogLevelAnswer>(payload);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const fuzz::ExactCopy payload(fuzz::input(data, size));
  check_requests(payload.span());
  check_answers(payload.span());
  return 0;
}
