#include "client/nif/inbound.hpp"

#include <cstring>
#include <memory>
#include <utility>

#include "client/nif/watch_table.hpp"
#include "proto/control/ns_register.hpp"

namespace gimnet::nif {
namespace {

/// The largest frame that this end takes, with its header: what space() always has room for.
constexpr std::size_t kFrameSizeMax = proto::kHeaderSize + proto::kFrameLengthDefault;

/// Another node wrote what stands behind the header; the hub only passed it on.
bool is_of_another_node(proto::Kind kind) {
  return kind < proto::Kind::link && kind != proto::Kind::report && kind != proto::Kind::flow;
}

}  // namespace

Inbound::~Inbound() {
  for (const Item& item : batch_) item.storage->release();
  if (slab_ != nullptr) slab_->release();
}

Inbound::Verdict Inbound::malformed(std::string why) {
  fault_ = std::move(why);
  return Verdict::malformed;
}

void Inbound::begin(const SessionTerms& session) {
  filled_ = parsed_ = charged_ = uncharged_bytes_ = 0;
  if (slab_ != nullptr && !slab_->is_only_reference()) std::exchange(slab_, nullptr)->release();
  id_ = session.id;
  confirm_bytes_ =
      session.resume ? std::max<std::uint64_t>(session.hub_resume_bytes / 4, 1) : UINT64_MAX;
  unconfirmed_bytes_ = 0;
  if (session.resumed) return tell_taken(assembler_.notices_again(std::nullopt));
  taken_ = 0;
  const MessageAssembler::Lost lost = assembler_.clear();
  counts_.messages_lost += lost.messages;
  if (lost.messages > 0) add_gap(0, lost.messages, proto::DropReason::cut_message);
  tell_taken(lost.notices);
  deliver();
}

void Inbound::tell_taken(const std::vector<MessageAssembler::Notice>& notices) {
  for (const auto& notice : notices) host_.send_taken(notice.to, notice.taken);
}

std::span<std::byte> Inbound::space() {
  if (slab_ != nullptr && parsed_ == filled_ && slab_->is_only_reference())
    filled_ = parsed_ = charged_ = 0;
  if (slab_ == nullptr || Slab::kBytes - parsed_ < kFrameSizeMax || filled_ == Slab::kBytes) {
    Slab* fresh = Slab::make();
    if (fresh == nullptr) return {};
    const std::size_t rest = filled_ - parsed_;
    if (slab_ != nullptr) {
      std::memcpy(fresh->bytes(), slab_->bytes() + parsed_, rest);
      if (!slab_->is_only_reference()) uncharged_bytes_ += parsed_ - charged_;
      slab_->release();
    }
    slab_ = fresh;
    parsed_ = charged_ = 0;
    filled_ = rest;
  }
  return {slab_->bytes() + filled_, Slab::kBytes - filled_};
}

Inbound::Verdict Inbound::take(std::size_t bytes, const Arrival& arrival) {
  filled_ += bytes;
  arrival_ = arrival;
  Verdict verdict = Verdict::going;
  while (verdict == Verdict::going) {
    const auto next = proto::next_run(slab_->bytes() + parsed_, slab_->bytes() + filled_,
                                      proto::kFrameLengthDefault);
    if (next.found == proto::Found::need_more) break;
    if (next.found == proto::Found::too_long) {
      verdict = malformed(proto::frame_error_text(proto::FrameError::too_long));
      break;
    }
    parsed_ += next.run.size;
    verdict = take_run(next.run);
  }
  deliver();
  return verdict;
}

void Inbound::deliver() {
  host_.deliver(batch_);
  batch_.clear();
}

Inbound::Verdict Inbound::take_run(const proto::RunView& run) {
  const std::byte* at = run.bytes;
  for (std::uint32_t i = 0; i < run.frames; ++i) {
    const std::size_t left = run.size - static_cast<std::size_t>(at - run.bytes);
    const auto view = proto::parse_frame({at, left}, proto::Origin::hub);
    if (view) {
      if (const Verdict verdict = take_frame(*view, at); verdict != Verdict::going) return verdict;
    } else if (const proto::Kind kind = proto::load_header(at).kind; kind == proto::Kind::report) {
      drop_report();
    } else if (is_of_another_node(kind)) {
      drop_unreadable(at);
    } else {
      return malformed(proto::frame_error_text(view.error()));
    }
    at += proto::load_header(at).frame_size();
  }
  return Verdict::going;
}

/// The hub counted it, too.
void Inbound::drop_unreadable(const std::byte* frame) {
  ++counts_.frames;
  ++taken_;
  unconfirmed_bytes_ += proto::load_header(frame).frame_size();
  ++counts_.unreadable;
}

/// Another hub wrote it. No hub counts REPORTs for resume.
void Inbound::drop_report() {
  ++counts_.frames;
  ++counts_.unreadable;
}

Inbound::Verdict Inbound::take_frame(const proto::FrameView& view, const std::byte* frame) {
  switch (view.header.kind) {
    case proto::Kind::flow:
      return take_flow(view);
    case proto::Kind::link:
      return take_link(view);
    case proto::Kind::ns:
    case proto::Kind::ctrl:
      return take_names(view);
    case proto::Kind::route:
      return malformed("ROUTE is for hubs only");
    default:
      return take_data(view, frame);
  }
}

Inbound::Verdict Inbound::take_data(const proto::FrameView& view, const std::byte* frame) {
  if (view.header.kind == proto::Kind::report) {
    take_report(view);
    return Verdict::going;
  }
  ++counts_.frames;
  ++taken_;
  unconfirmed_bytes_ += view.header.frame_size();
  switch (view.header.kind) {
    case proto::Kind::unicast:
      // Never to another node than the one addressed, whatever the hub thinks.
      if (view.header.dst != id_) break;
      return take_message(view, frame);
    case proto::Kind::group:
    case proto::Kind::list:
    case proto::Kind::broadcast:
    case proto::Kind::service:
      return take_message(view, frame);
    case proto::Kind::taken: {
      if (view.header.dst != id_) break;
      const auto taken = proto::decode_taken(view.payload);
      if (taken) {
        host_.on_taken(view.header.src, *taken);
      } else {
        ++counts_.unreadable;
      }
      return Verdict::going;
    }
    default:
      break;
  }
  ++counts_.ignored;
  return Verdict::going;
}

Inbound::Verdict Inbound::take_message(const proto::FrameView& view, const std::byte* frame) {
  if (view.fragment) return take_fragment(view, frame);
  if (const std::uint32_t lost = assembler_.interrupt(view.header); lost > 0) {
    counts_.messages_lost += lost;
    add_gap(view.header.src, lost, proto::DropReason::cut_message);
  }
  if (may_wait(view.header, view.header.frame_size())) add_frame(view, frame);
  return Verdict::going;
}

Inbound::Verdict Inbound::take_fragment(const proto::FrameView& view, const std::byte* frame) {
  MessageAssembler::Step step = assembler_.take(view, arrival_.steady_ns);
  proto::Reassembled& reassembled = step.reassembled;
  if (step.notice) host_.send_taken(step.notice->to, step.notice->taken);
  if (std::uint32_t cut = reassembled.lost_messages; cut > 0) {
    counts_.messages_lost += cut;
    const bool too_large = reassembled.state == proto::Reassembled::State::too_large;
    if (too_large) --cut;  // this one; others ended before it
    if (cut > 0) add_gap(view.header.src, cut, proto::DropReason::cut_message);
    if (too_large) add_too_large(view, frame);
  }
  counts_.messages_lost += reassembled.displaced.size();
  for (const std::uint32_t source : reassembled.displaced)
    add_gap(source, 1, proto::DropReason::cut_message);
  if (reassembled.state != proto::Reassembled::State::whole) {
    if (view.header.kind == proto::Kind::group && view.ends_message())
      host_.on_message_lost(view.header.dst);
    return Verdict::going;
  }
  const bool in_one_piece = reassembled.storage.empty();
  if (!may_wait(view.header, in_one_piece ? view.header.frame_size() : reassembled.storage.size()))
    return Verdict::going;
  if (in_one_piece) {
    add_frame(view, frame);
    return Verdict::going;
  }
  add_whole(view, frame, std::move(reassembled.storage));
  return Verdict::going;
}

void Inbound::add_whole(const proto::FrameView& view, const std::byte* frame, ByteBuffer payload) {
  auto record = std::make_unique<Record>();
  record->incoming = incoming_of({nullptr, frame, arrival_.wall_ns, 0, 0});
  record->payload = std::move(payload);
  record->spares = assembler_.spares();
  record->extensions.assign(view.extensions.begin(), view.extensions.end());
  record->incoming.epoch = epoch_of(view.header);
  record->finish();
  ++counts_.messages;
  const std::size_t bytes = record->payload.size();
  add_record(record.release(), bytes);
}

bool Inbound::may_wait(const proto::FrameHeader& header, std::size_t bytes) {
  if (header.kind != proto::Kind::group || host_.may_wait(header.dst, bytes)) return true;
  ++counts_.messages_lost;
  host_.on_message_lost(header.dst);
  return false;
}

/// The message pays for its own bytes and for what lies before it in slabs that messages keep: of
/// 256 KiB that another node wrote, one message may be all that the program gets.
void Inbound::add_frame(const proto::FrameView& view, const std::byte* frame) {
  // Other libraries may send larger ones in one piece. Data of this size are aligned.
  const auto size = static_cast<std::uint32_t>(view.payload.size());
  if (size > proto::kUncutMessageMax) {
    ByteBuffer copy = assembler_.spares()->take(size, data_begin(view, size));
    if (copy.reserve(size) && copy.append(view.payload))
      return add_whole(view, frame, std::move(copy));
  }
  const std::size_t end =
      static_cast<std::size_t>(frame - slab_->bytes()) + view.header.frame_size();
  const std::size_t bytes = std::exchange(uncharged_bytes_, 0) + end - charged_;
  charged_ = end;
  batch_.push_back({slab_, frame, arrival_.wall_ns, bytes, epoch_of(view.header)});
  slab_->add_reference();
  ++counts_.messages;
}

std::uint32_t Inbound::epoch_of(const proto::FrameHeader& header) {
  return header.kind == proto::Kind::group ? host_.epoch_for(header.dst) : 0;
}

void Inbound::add_record(Record* record, std::size_t bytes) {
  record->incoming.arrival_ns = arrival_.wall_ns;
  batch_.push_back(item_of(record, bytes));
}

void Inbound::add_events(std::span<const Item> events) {
  for (const Item& event : events)
    static_cast<Record*>(event.storage)->incoming.arrival_ns = arrival_.wall_ns;
  batch_.insert(batch_.end(), events.begin(), events.end());
}

void Inbound::add_gap(std::uint32_t from, std::uint64_t count, proto::DropReason reason) {
  ++counts_.gaps;
  Record* record = make_event(NIF_GAP, proto::drop_reason_name(reason));
  record->incoming.from = from;
  record->incoming.count = count;
  record->incoming.reason = static_cast<std::uint32_t>(reason);
  add_record(record, 0);
}

void Inbound::add_too_large(const proto::FrameView& view, const std::byte* frame) {
  ++counts_.gaps;
  add_record(make_too_large(incoming_of({nullptr, frame, 0, 0, 0}), view.payload), 0);
}

Inbound::Verdict Inbound::take_flow(const proto::FrameView& view) {
  const auto message = proto::flow::decode(view.payload);
  if (!message) return malformed("FLOW is too short or has an unknown operation");
  if (const auto* skip = std::get_if<proto::flow::Skip>(&*message)) {
    const bool unknown = skip->count == proto::flow::kSkipUnknown;
    if (!unknown && skip->count > UINT64_MAX - 1 - taken_)
      return malformed("SKIP has an impossible count");
    if (!unknown) taken_ += skip->count;
    add_gap(0, unknown ? NIF_COUNT_UNKNOWN : skip->count, skip->reason);
    return Verdict::going;
  }
  if (const auto* dropped = std::get_if<proto::flow::Dropped>(&*message)) {
    add_gap(dropped->source.value(), dropped->count, dropped->reason);
    return Verdict::going;
  }
  return host_.on_flow(*message) ? Verdict::going
                                 : malformed("CONFIRM names more frames than were sent");
}

Inbound::Verdict Inbound::take_link(const proto::FrameView& view) {
  auto goodbye = proto::decode<proto::Goodbye>(view.payload);
  if (!goodbye) return malformed("LINK after WELCOME is not GOODBYE: " + goodbye.error().sentence);
  goodbye_ = std::move(*goodbye);
  return Verdict::goodbye;
}

Inbound::Verdict Inbound::take_names(const proto::FrameView& view) {
  const auto control = proto::split_control(view.payload);
  if (!control) return malformed("NS or CTRL without an operation");
  if (control->header.is_answer()) {
    add_events(host_.on_answer(view.header.kind, *control));
    return Verdict::going;
  }
  if (view.header.kind == proto::Kind::ns) return take_event(*control, view.payload);
  ++counts_.ignored;
  return Verdict::going;
}

void Inbound::add_moved(const proto::ns::ServiceMoved& event) {
  Record* record = make_event(NIF_SERVICE_MOVED, event.name);
  put_service(record->incoming, event);
  add_record(record, event.name.size());
}

Inbound::Verdict Inbound::take_event(const proto::ControlView& event,
                                     std::span<const std::byte> payload) {
  switch (static_cast<proto::ns::NsOperation>(event.header.operation)) {
    case proto::ns::NsOperation::service_moved: {
      const auto moved = proto::decode<proto::ns::ServiceMoved>(payload);
      if (!moved) return malformed(moved.error().sentence);
      if (host_.on_service_moved(*moved)) add_moved(*moved);
      return Verdict::going;
    }
    case proto::ns::NsOperation::subscribers: {
      const auto subscribers = proto::decode<proto::ns::Subscribers>(payload);
      if (!subscribers) return malformed(subscribers.error().sentence);
      Record* record = make_event(NIF_SUBSCRIBERS, "");
      record->incoming.group = subscribers->group.value();
      record->incoming.count = subscribers->subscribers;
      add_record(record, 0);
      return Verdict::going;
    }
    case proto::ns::NsOperation::watch_events:
      return take_watch_events(payload);
    case proto::ns::NsOperation::name_lost:
      return take_name_lost(payload);
    default:
      ++counts_.ignored;
      return Verdict::going;
  }
}

Inbound::Verdict Inbound::take_watch_events(std::span<const std::byte> payload) {
  const auto events = proto::decode<proto::ns::WatchEvents>(payload);
  if (!events) return malformed(events.error().sentence);
  if (!host_.on_watch_events(*events)) return Verdict::going;
  for (const proto::ns::Change& change : events->changes) {
    // Changes are small beside what the queue has to keep of each.
    add_record(make_watched(*events, change), sizeof(proto::ns::Change));
  }
  return Verdict::going;
}

Inbound::Verdict Inbound::take_name_lost(std::span<const std::byte> payload) {
  const auto event = proto::decode<proto::ns::NameLost>(payload);
  if (!event) return malformed(event.error().sentence);
  Record* record = make_event(NIF_NAME_LOST, event->name);
  record->incoming.from = event->holder.value();
  add_record(record, event->name.size());
  if (host_.is_own_service(event->name)) return Verdict::going;
  goodbye_ = {proto::GoodbyeCode::replaced, event->sentence};
  return Verdict::goodbye;
}

void Inbound::take_report(const proto::FrameView& view) {
  auto report = proto::decode_report(view.payload);
  const bool misread = proto::check_header_of_hub_word(view.header) != proto::FrameError::none;
  if (!report || misread) return drop_report();
  ++counts_.frames;
  if (host_.on_report(*report)) return;
  // As if the message had come in one frame: programs know of no fragments.
  const auto start = host_.message_of(*report);
  if (start) {
    report->header.flags &= static_cast<std::uint8_t>(~proto::kFlagFragment);
    report->following = *start;
  }
  add_record(make_report(*report, view.header.src), proto::kReportSizeMax);
}

}  // namespace gimnet::nif
