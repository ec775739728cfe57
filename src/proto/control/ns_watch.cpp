#include "proto/control/ns_watch.hpp"

#include "proto/control/names.hpp"

namespace gimnet::proto::ns {
namespace {

Change read_change(Fields& fields) {
  Change change;
  change.kind = static_cast<ChangeKind>(fields.required_number<std::uint8_t>(1, "kind of change"));
  change.version = fields.number<std::uint64_t>(2, "version", 0);
  change.former_name = fields.text(3, "former name", kNameBytesMax);
  auto nodes = fields.records<NodeRecord>(4, "node", read_node_record);
  auto services = fields.records<ServiceRecord>(5, "service", read_service_record);
  if (nodes.size() + services.size() > 1) fields.fail("has a change of more than one");
  if (!nodes.empty()) change.node = std::move(nodes.front());
  if (!services.empty()) change.service = std::move(services.front());
  return change;
}

}  // namespace

void Watch::write(bitestream::Writer& writer) const {
  writer.put_u32(3, watch);
  put_clean_text(writer, 4, pattern, kWrittenNameBytesMax);
  if (subjects != kWatchAll) writer.put_u8(5, subjects);
  if (epoch != 0) {
    writer.put_u64(6, epoch);
    writer.put_u64(7, version);
  }
}
Watch Watch::read(Fields& fields) {
  Watch watch;
  watch.watch = fields.required_number<std::uint32_t>(3, "watch");
  watch.pattern = fields.text(4, "pattern", kNameBytesMax);
  watch.subjects = fields.number<std::uint8_t>(5, "set of subjects", kWatchAll);
  if (watch.subjects == 0 || watch.subjects > kWatchAll)
    fields.fail("has an unknown set of subjects");
  watch.epoch = fields.number<std::uint64_t>(6, "epoch", 0);
  watch.version = fields.number<std::uint64_t>(7, "version", 0);
  if (watch.epoch == 0) watch.version = 0;
  return watch;
}

void WatchAnswer::write(bitestream::Writer& writer) const { writer.put_bool(3, snapshot); }
WatchAnswer WatchAnswer::read(Fields& fields) { return {fields.flag(3, "snapshot", true)}; }

void Unwatch::write(bitestream::Writer& writer) const { writer.put_u32(3, watch); }
Unwatch Unwatch::read(Fields& fields) {
  return {fields.required_number<std::uint32_t>(3, "watch")};
}

void WatchTaken::write(bitestream::Writer& writer) const {
  writer.put_u32(3, watch);
  writer.put_u32(4, frames);
}
WatchTaken WatchTaken::read(Fields& fields) {
  return {fields.required_number<std::uint32_t>(3, "watch"),
          fields.number<std::uint32_t>(4, "number of frames", 1)};
}

void write_change(bitestream::Writer& writer, const Change& change) {
  writer.begin_nested(3);
  writer.put_u8(1, static_cast<std::uint8_t>(change.kind));
  writer.put_u64(2, change.version);
  put_clean_text(writer, 3, change.former_name, kNameBytesMax);
  if (change.node) {
    writer.begin_nested(4);
    write_record(writer, *change.node);
    writer.end_nested();
  }
  if (change.service) {
    writer.begin_nested(5);
    write_record(writer, *change.service);
    writer.end_nested();
  }
  writer.end_nested();
}

void WatchEvents::write(bitestream::Writer& writer) const {
  for (const Change& change : changes) write_change(writer, change);
  write_head(writer);
}
void WatchEvents::write_head(bitestream::Writer& writer) const {
  writer.put_u32(4, watch);
  writer.put_u16(5, hub.value());
  writer.put_u64(6, epoch);
  writer.put_u64(7, after);
  writer.put_u64(8, version);
}
WatchEvents WatchEvents::read(Fields& fields) {
  WatchEvents events;
  events.changes = fields.records<Change>(3, "change", read_change);
  events.watch = fields.required_number<std::uint32_t>(4, "watch");
  events.hub = HubId{fields.number<std::uint16_t>(5, "hub id", 0)};
  events.epoch = fields.number<std::uint64_t>(6, "epoch", 0);
  events.after = fields.number<std::uint64_t>(7, "version before", 0);
  events.version = fields.number<std::uint64_t>(8, "version", 0);
  return events;
}

}  // namespace gimnet::proto::ns
