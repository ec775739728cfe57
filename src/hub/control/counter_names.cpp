#include "hub/control/counter_names.hpp"

#include <array>
#include <string_view>

namespace gimnet::hub {
namespace {

struct Named {
  std::string_view name;
  Counter ShardCounters::* field;
};

#define GIMNET_COUNTER(field) \
  Named { #field, &ShardCounters::field }
constexpr std::array kCounters{
    GIMNET_COUNTER(accepted),
    GIMNET_COUNTER(copies),
    GIMNET_COUNTER(delivered),
    GIMNET_COUNTER(queued),
    GIMNET_COUNTER(received_bytes),
    GIMNET_COUNTER(sent_bytes),
    GIMNET_COUNTER(receive_calls),
    GIMNET_COUNTER(send_calls),
    GIMNET_COUNTER(turns),
    GIMNET_COUNTER(copied_bytes),
    GIMNET_COUNTER(moved_tail_bytes),
    GIMNET_COUNTER(mailbox_entries),
    GIMNET_COUNTER(mailbox_frames),
    GIMNET_COUNTER(mailbox_wakeups),
    GIMNET_COUNTER(connections),
    GIMNET_COUNTER(sessions),
    GIMNET_COUNTER(malformed),
    GIMNET_COUNTER(wrong_source),
    GIMNET_COUNTER(silent),
    GIMNET_COUNTER(slow_consumers),
    GIMNET_COUNTER(stalled_frames),
    GIMNET_COUNTER(unfinished_frames),
    GIMNET_COUNTER(pauses),
    GIMNET_COUNTER(resumes),
    GIMNET_COUNTER(reports),
    GIMNET_COUNTER(reports_lost),
    GIMNET_COUNTER(held_reads),
    GIMNET_COUNTER(untaken_frames),
    GIMNET_COUNTER(gap_frames),
    GIMNET_COUNTER(resumed),
    GIMNET_COUNTER(lane0_demoted),
    GIMNET_COUNTER(bad_credits),
    GIMNET_COUNTER(not_retained),
    GIMNET_COUNTER(scarce_turns),
    GIMNET_COUNTER(pinned_bytes),
    GIMNET_COUNTER(pinned_bytes_max),
    GIMNET_COUNTER(allocated_bytes),
    GIMNET_COUNTER(too_many_requests),
    GIMNET_COUNTER(oddities),
    GIMNET_COUNTER(no_memory),
};
#undef GIMNET_COUNTER

// Every field of ShardCounters is a Counter, but for the padding at its end: one that is added
// there and forgotten here shows.
constexpr std::size_t kListed = kCounters.size() + proto::kDropReasonCount;
static_assert(sizeof(ShardCounters) >= kListed * sizeof(Counter) &&
              sizeof(ShardCounters) - kListed * sizeof(Counter) < alignof(ShardCounters));

using Take = std::function<void(const std::string& name, std::uint64_t value)>;

template <class Protocol>
void take_requests(const std::string& prefix, const Protocol& counters,
                   const char* (*name_of)(std::uint16_t), const Take& take) {
  for (std::size_t operation = 0; operation < counters.by_operation.size(); ++operation) {
    const char* name = name_of(static_cast<std::uint16_t>(operation));
    if (name != nullptr) take(prefix + name, counters.by_operation[operation].value());
  }
  take(prefix + "unknown", counters.unknown.value());
  for (std::size_t status = 1; status < counters.refused.size(); ++status) {
    take(prefix + "refused." + proto::status_name(static_cast<proto::Status>(status)),
         counters.refused[status].value());
  }
}

}  // namespace

void for_each_counter(const ShardCounters& counters, const Take& take) {
  for (const Named& named : kCounters)
    take(std::string{named.name}, (counters.*named.field).value());
  for (std::size_t reason = 1; reason < proto::kDropReasonCount; ++reason) {
    const auto drop = static_cast<proto::DropReason>(reason);
    if (drop == proto::DropReason::not_retained) continue;  // nothing is dropped
    const auto* name = proto::drop_reason_name(drop);
    take(std::string{"dropped."} + name, counters.dropped[reason].value());
  }
}

void for_each_counter(const RefusalCounters& counters, const Take& take) {
  for (std::size_t code = 0; code < counters.by_code.size(); ++code) {
    const auto* name = proto::goodbye_name(static_cast<proto::GoodbyeCode>(code));
    take(std::string{"refused."} + name, counters.by_code[code].value());
  }
  take("refused.garbage", counters.garbage.value());
  take("refused.unfinished", counters.unfinished.value());
  take("refused.no_descriptor", counters.no_descriptor.value());
  take("links.overrun", counters.links_overrun.value());
}

void for_each_counter(const RequestCounters& counters, const Take& take) {
  take_requests("names.", counters.names, proto::ns::operation_name, take);
  take("names.resyncs", counters.resyncs.value());
  take_requests("ctrl.", counters.ctrl, proto::ctrl::operation_name, take);
}

}  // namespace gimnet::hub
