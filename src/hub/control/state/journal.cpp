#include "hub/control/state/journal.hpp"

#include "base/check.hpp"

namespace gimnet::hub {

void Journal::add(proto::ns::Change change) {
  GIMNET_CHECK(keeps_);
  GIMNET_CHECK(change.node.has_value() != change.service.has_value());
  change.version = ++version_;
  proto::bitestream::Writer writer;
  proto::ns::write_change(writer, change);
  GIMNET_CHECK(writer.finish() == BITESTREAM_OK);
  Note note;
  if (change.service) {
    note.subject = change.service->group;
    note.name = change.service->name;
  } else {
    note.subject = change.node->node;
    note.name = change.node->name;
  }
  note.former_name = change.former_name;
  note.bytes.assign(writer.bytes().begin(), writer.bytes().end());
  bytes_ += size_of(note);
  notes_.push_back(std::move(note));
  while (notes_.size() > limits_.watch_changes || bytes_ > limits_.watch_bytes) {
    bytes_ -= size_of(notes_.front());
    notes_.pop_front();
  }
}

std::size_t Journal::size_of(const Note& note) {
  return sizeof(Note) + note.name.size() + note.former_name.size() + note.bytes.size();
}

}  // namespace gimnet::hub
