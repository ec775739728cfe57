#include "hub/data/egress/entry.hpp"

#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {

void Entry::note_fragment() {
  const auto frame = proto::parse_frame({run.bytes, run.size}, proto::Origin::hub);
  if (!frame || !frame->fragment) return;
  fragmented = true;
  message_number = frame->fragment->message;
  touched = frame->fragment->offset != 0;  // unless its beginning still waits
  complete = frame->fragment->offset + frame->payload.size() == frame->fragment->total;
}

}  // namespace gimnet::hub
