#include "hub/data/egress/counted_groups.hpp"

#include "proto/frame/frame_parser.hpp"

namespace gimnet::hub {

void CountedGroups::on_entry_lost(const Entry& entry) {
  const proto::FrameHeader header = entry.run.header();
  if (header.kind == proto::Kind::group) on_lost(GroupId{header.dst}, entry.messages());
}

void CountedGroups::on_run_lost(const Run& run, const proto::FrameHeader& header) {
  if (header.kind != proto::Kind::group) return;
  if (header.has(proto::kFlagFragment)) return on_run_lost(run);
  on_lost(GroupId{header.dst}, run.frames);
}

void CountedGroups::on_run_lost(const Run& run) {
  for (Run rest = run.share(); rest.frames != 0; rest.skip_frame()) {
    const proto::FrameHeader header = rest.header();
    if (header.kind != proto::Kind::group) continue;
    const auto frame = proto::parse_frame({rest.bytes, rest.size}, proto::Origin::hub);
    if (frame && frame->ends_message()) on_lost(GroupId{header.dst}, 1);
  }
}

}  // namespace gimnet::hub
