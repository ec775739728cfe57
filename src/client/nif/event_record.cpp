#include "client/nif/event_record.hpp"

#include <array>
#include <memory>
#include <span>
#include <utility>

#include "base/endian.hpp"

namespace gimnet::nif {

Record* make_event(nif_incoming_type type, std::string text) {
  auto record = std::make_unique<Record>();
  record->incoming.type = type;
  record->text = std::move(text);
  record->finish();
  return record.release();
}

Record* make_report(const proto::Report& report, std::uint32_t from) {
  const proto::FrameHeader& header = report.header;
  Record* record = make_event(NIF_REPORT, proto::drop_reason_name(report.reason));
  nif_incoming& in = record->incoming;
  in.from = from;
  in.reason = static_cast<std::uint32_t>(report.reason);
  // The question of this library that is the last of them is not one of the program's messages.
  in.count = header.kind == proto::Kind::taken ? report.count - 1 : report.count;
  in.to = header.dst;
  in.kind = static_cast<std::uint8_t>(header.kind);
  in.lane = header.lane & proto::kLaneMask;
  in.policy = static_cast<std::uint8_t>(header.policy());
  const bool plain = !header.has(proto::kFlagExt | proto::kFlagFragment);
  if (plain && header.has(proto::kFlagKeyed) && report.following.size() >= sizeof(std::uint64_t)) {
    in.key = load_le<std::uint64_t>(report.following.data());
    in.flags = NIF_FLAG_KEYED;
  }
  std::array<std::byte, proto::kReportSizeMax> whole;
  const std::size_t size = proto::encode_report(report, whole);
  if (record->payload.append(std::span(whole).first(size).subspan(8))) record->finish();
  return record;
}

Item item_of(Record* record, std::size_t bytes) {
  return {record, nullptr, 0, bytes + sizeof(Record), 0};
}

void put_service(nif_incoming& incoming, const proto::ns::ServiceState& state) {
  incoming.group = state.group.value();
  incoming.from = state.provider.value();
  incoming.count = state.session;
  incoming.message_type = state.message_type;
  incoming.instance = state.instance;
  incoming.delivery = static_cast<std::uint32_t>(state.delivery);
  incoming.direction = static_cast<std::uint32_t>(state.direction);
}

}  // namespace gimnet::nif
