#include "client/nif/message_assembler.hpp"

#include <utility>

#include "proto/gimi/message_header.hpp"

namespace gimnet::nif {
namespace {

std::uint64_t window_key(std::uint32_t sender, std::uint32_t message) {
  return (static_cast<std::uint64_t>(sender) << 32) | message;
}

/// Smaller ones are allowed as a whole before the first TAKEN, so nobody waits for one.
bool has_window(const proto::FrameView& view) {
  return view.header.kind == proto::Kind::unicast && view.fragment->total > proto::kWindowDefault;
}

}  // namespace

std::size_t data_begin(const proto::FrameView& view, std::uint32_t size) {
  return size - proto::gimi::application_bytes(view.key.has_value(), view.payload, size);
}

void MessageAssembler::forget_ended() {
  std::unordered_map<std::uint64_t, OpenMessage> open;
  for (const auto& standing : reassembler_.standings(std::nullopt)) {
    if (!standing.open) continue;
    auto window = windows_.extract(window_key(standing.stream.src, standing.open->message));
    if (!window.empty()) open.insert(std::move(window));
  }
  windows_.swap(open);
}

std::optional<proto::Taken> MessageAssembler::progress(const proto::FrameView& view,
                                                       std::uint32_t taken, std::int64_t now_ns) {
  const proto::FragmentHeader& fragment = *view.fragment;
  const std::uint64_t key = window_key(view.header.src, fragment.message);
  auto found = windows_.find(key);
  if (found == windows_.end()) {
    if (windows_.size() >= limits_.streams_max) forget_ended();
    found =
        windows_
            .emplace(key, OpenMessage{.progress = {fragment.message, fragment.total}, .tuning = {}})
            .first;
  }
  OpenMessage& open = found->second;
  std::optional<proto::Taken> notice;
  open.tuning.on_received(taken, now_ns);
  if (open.progress.due(taken)) {
    open.tuning.on_taken(taken, now_ns);
    open.progress.set_window(open.tuning.window());
    notice = open.progress.tell(taken);
  }
  if (taken == fragment.total) windows_.erase(found);
  return notice;
}

MessageAssembler::Step MessageAssembler::take(const proto::FrameView& view, std::int64_t now_ns) {
  const proto::FragmentHeader& fragment = *view.fragment;
  ByteBuffer memory;
  if (fragment.offset == 0 && view.payload.size() < fragment.total)
    memory = spares_->take(fragment.total, data_begin(view, fragment.total));
  Step step{reassembler_.take(proto::FragmentStream::of(view.header), fragment, view.payload,
                              std::move(memory)),
            std::nullopt};
  using State = proto::Reassembled::State;
  if (!has_window(view)) return step;
  if (step.reassembled.state == State::part || step.reassembled.state == State::whole) {
    if (const auto taken = progress(view, step.reassembled.taken, now_ns))
      step.notice = Notice{view.header.src, *taken};
    return step;
  }
  windows_.erase(window_key(view.header.src, fragment.message));
  step.notice = Notice{view.header.src, proto::ReceiveWindow::refusal(fragment.message)};
  return step;
}

std::vector<MessageAssembler::Notice> MessageAssembler::notices_again(
    std::optional<NodeId> sender) {
  std::vector<Notice> notices;
  for (const auto& standing : reassembler_.standings(sender)) {
    const std::uint32_t to = standing.stream.src;
    if (standing.stream.kind != proto::Kind::unicast) continue;
    if (standing.lost) notices.push_back({to, proto::ReceiveWindow::refusal(*standing.lost)});
    if (!standing.open) continue;
    const auto found = windows_.find(window_key(to, standing.open->message));
    if (found == windows_.end()) continue;
    notices.push_back({to, found->second.progress.tell(standing.open->offset)});
  }
  return notices;
}

MessageAssembler::Lost MessageAssembler::clear() {
  Lost lost;
  for (const auto& [key, open] : windows_) {
    const auto message = static_cast<std::uint32_t>(key);
    lost.notices.push_back(
        {static_cast<std::uint32_t>(key >> 32), proto::ReceiveWindow::refusal(message)});
  }
  windows_.clear();
  lost.messages = reassembler_.clear();
  return lost;
}

}  // namespace gimnet::nif
