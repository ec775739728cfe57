#include "tests/hub/shard/support/fake_node.hpp"

#include <gtest/gtest.h>

namespace gimnet::hub::testing {

void FakeNode::on_frame(const GotFrame& frame) {
  kinds.push_back(frame.header.kind);
  const bool is_data = static_cast<std::uint8_t>(frame.header.kind) < proto::kFirstControlKind &&
                       frame.header.kind != proto::Kind::flow &&
                       frame.header.kind != proto::Kind::report;
  if (is_data) {
    frames.push_back(frame);
    ++data_frames;
    return;
  }
  control.push_back(frame);
  if (frame.header.kind == proto::Kind::link) {
    if (const auto message = proto::decode<proto::Welcome>(frame.body)) {
      welcome = *message;
      if (!welcome->resumed) data_frames = 0;
    }
    if (const auto message = proto::decode<proto::Goodbye>(frame.body)) goodbye = *message;
  } else if (frame.header.kind == proto::Kind::flow) {
    const auto message = proto::flow::decode(frame.body);
    if (!message) ADD_FAILURE() << "the hub sent FLOW that nobody can read";
    if (const auto* skip = message ? std::get_if<proto::flow::Skip>(&*message) : nullptr) {
      data_frames += skip->count;
      skipped += skip->count;
    }
  }
}

void FakeNode::read(std::size_t most) {
  pipe.read(stream, most);
  std::size_t begin = 0;
  if (!opened && stream.size() >= proto::kOpeningSize) {
    if (!std::equal(proto::kOpening.begin(), proto::kOpening.end(), stream.begin()))
      ADD_FAILURE() << "no opening";
    opened = true;
    begin = proto::kOpeningSize;
  }
  while (opened && stream.size() - begin >= proto::kHeaderSize) {
    const proto::FrameHeader header = proto::load_header(stream.data() + begin);
    if (header.length > proto::kFrameLengthMax) {
      ADD_FAILURE() << "the hub sent a header with length " << header.length;
      stream.clear();
      return;
    }
    if (stream.size() - begin < header.frame_size()) break;
    const auto body = stream.begin() + static_cast<std::ptrdiff_t>(begin + proto::kHeaderSize);
    begin += header.frame_size();
    on_frame({header, {body, body + header.length}});
  }
  stream.erase(stream.begin(), stream.begin() + static_cast<std::ptrdiff_t>(begin));
}

std::vector<std::string> FakeNode::texts() const {
  std::vector<std::string> all;
  for (const GotFrame& frame : frames) all.push_back(frame.text());
  return all;
}

std::vector<proto::flow::Message> FakeNode::flow() const {
  std::vector<proto::flow::Message> all;
  for (const GotFrame& frame : control) {
    if (frame.header.kind != proto::Kind::flow) continue;
    if (const auto message = proto::flow::decode(frame.body)) all.push_back(*message);
  }
  return all;
}

std::vector<proto::Report> FakeNode::reports() const {
  std::vector<proto::Report> all;
  for (const GotFrame& frame : control) {
    if (frame.header.kind != proto::Kind::report) continue;
    if (const auto report = proto::decode_report(frame.body)) all.push_back(*report);
  }
  return all;
}

}  // namespace gimnet::hub::testing
