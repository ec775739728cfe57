#include "proto/control/link.hpp"

#include <algorithm>

#include "proto/control/names.hpp"

namespace gimnet::proto {
namespace {

constexpr std::size_t kVersionOffset = 6;

// Keys of HELLO and of WELCOME.
namespace hello_key {
enum : std::uint32_t {
  role = 1,
  name,
  token,
  epoch,
  resume,
  frame_length_max,
  features,
  description,
  resume_epoch,
  resume_taken,
  shard,
  resume_buffer_bytes,
  former,
};
}  // namespace hello_key

namespace welcome_key {
enum : std::uint32_t {
  node = 1,
  token,
  hub,
  hub_name,
  epoch,
  frame_length_max,
  features,
  keep_alive_ms,
  silent_ms,
  hub_time,
  resumed,
  taken,
  resume_buffer_bytes,
  grace_ms,
  last_goodbye_code = 16,
  last_goodbye_sentence,
  name,
  retained_bytes_max,
};
}  // namespace welcome_key

namespace goodbye_key {
enum : std::uint32_t { code = 1, sentence };
}  // namespace goodbye_key

/// In HELLO and in WELCOME.
namespace introduction_key {
enum : std::uint32_t {
  hub = 20,
  unique,
  instance,
  configured,
  hub_name,
  version,
  link_name,
  cost,
  keep_alive_ms,
  silent_ms,
  features_required,
  counts,
};
}  // namespace introduction_key

void write_introduction(bitestream::Writer& writer, const HubIntroduction& said) {
  namespace key = introduction_key;
  writer.put_u16(key::hub, said.hub.hub.value());
  writer.put_opaque(key::unique, std::as_bytes(std::span(said.hub.unique.bytes)));
  writer.put_u64(key::instance, said.instance.value());
  writer.put_bool(key::configured, said.configured);
  put_clean_text(writer, key::hub_name, said.hub_name, kNameBytesMax);
  put_clean_text(writer, key::version, said.version, kIntroducedVersionBytesMax);
  put_clean_text(writer, key::link_name, said.link_name, kLinkNameBytesMax);
  if (said.cost != 0) writer.put_u16(key::cost, said.cost);
  writer.put_u32(key::keep_alive_ms, said.keep_alive_ms);
  writer.put_u32(key::silent_ms, said.silent_ms);
  if (said.features_required != 0) writer.put_u64(key::features_required, said.features_required);
  if (said.counts != 0) writer.put_u64(key::counts, said.counts);
}

std::optional<HubIntroduction> read_introduction(Fields& fields) {
  namespace key = introduction_key;
  if (!fields.has(key::hub)) return std::nullopt;
  HubIntroduction said;
  said.hub.hub = HubId{fields.number<std::uint16_t>(key::hub, "hub id", 0)};
  if (said.hub.hub.value() == 0 || said.hub.hub.value() > kHubIdMax)
    fields.fail("has a hub id outside 1..4094");
  const auto unique = fields.opaque(key::unique, "unique id", said.hub.unique.bytes.size());
  if (unique.size() == said.hub.unique.bytes.size()) {
    std::ranges::transform(unique, said.hub.unique.bytes.begin(),
                           [](std::byte each) { return std::to_integer<std::uint8_t>(each); });
  } else {
    fields.fail("has no unique id of 16 bytes");
  }
  said.instance = HubInstance{fields.required_number<std::uint64_t>(key::instance, "instance")};
  said.configured = fields.flag(key::configured, "configured id", false);
  said.hub_name = fields.text(key::hub_name, "hub name", kNameBytesMax);
  said.version = fields.text(key::version, "version", kIntroducedVersionBytesMax);
  said.link_name = fields.text(key::link_name, "link name", kLinkNameBytesMax);
  said.cost = fields.number<std::uint16_t>(key::cost, "cost", 0);
  said.keep_alive_ms = fields.number<std::uint32_t>(key::keep_alive_ms, "keep-alive interval", 0);
  said.silent_ms = fields.number<std::uint32_t>(key::silent_ms, "silent time", 0);
  said.features_required =
      fields.number<std::uint64_t>(key::features_required, "required feature set", 0);
  said.counts = fields.number<std::uint64_t>(key::counts, "number of its counts", 0);
  return said;
}

}  // namespace

Opening check_opening(std::span<const std::byte> bytes) {
  const std::size_t mark = std::min(bytes.size(), kVersionOffset);
  if (!std::equal(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(mark),
                  kOpening.begin())) {
    return Opening::other_protocol;
  }
  if (bytes.size() > kVersionOffset && bytes[kVersionOffset] != std::byte{kVersionMajor})
    return Opening::bad_version;
  return bytes.size() < kOpeningSize ? Opening::need_more : Opening::accepted;
}

void Hello::write(bitestream::Writer& writer) const {
  namespace key = hello_key;
  writer.put_u8(key::role, static_cast<std::uint8_t>(role));
  put_clean_text(writer, key::name, name, kAdmissionBytesMax);
  writer.put_opaque(key::token, token);
  writer.put_u64(key::epoch, epoch);
  writer.put_bool(key::resume, resume);
  writer.put_u32(key::frame_length_max, frame_length_max);
  writer.put_u64(key::features, features);
  put_clean_text(writer, key::description, description, kDescriptionBytesMax);
  if (resume_epoch != 0) writer.put_u64(key::resume_epoch, resume_epoch);
  if (resume_taken != 0) writer.put_u64(key::resume_taken, resume_taken);
  if (shard) writer.put_u16(key::shard, *shard);
  writer.put_u32(key::resume_buffer_bytes, resume_buffer_bytes);
  if (former != NodeId{}) writer.put_u32(key::former, former.value());
  if (introduction) write_introduction(writer, *introduction);
}

Hello Hello::read(Fields& fields) {
  namespace key = hello_key;
  Hello hello;
  hello.role = static_cast<Role>(fields.number<std::uint8_t>(key::role, "role", 0));
  // Longer names than are allowed pass, so that they are answered with bad_name.
  hello.name = fields.text(key::name, "name", kAdmissionBytesMax);
  hello.token = fields.opaque(key::token, "session token", kTokenBytesMax);
  hello.epoch = fields.number<std::uint64_t>(key::epoch, "epoch", 0);
  hello.resume = fields.flag(key::resume, "resume wish", false);
  hello.frame_length_max =
      fields.number<std::uint32_t>(key::frame_length_max, "largest frame", kFrameLengthDefault);
  hello.features = fields.number<std::uint64_t>(key::features, "feature set", 0);
  hello.description = fields.text(key::description, "description", kDescriptionBytesMax);
  hello.resume_epoch = fields.number<std::uint64_t>(key::resume_epoch, "hub epoch", 0);
  hello.resume_taken = fields.number<std::uint64_t>(key::resume_taken, "count of frames taken", 0);
  if (fields.has(key::shard)) hello.shard = fields.number<std::uint16_t>(key::shard, "shard", 0);
  hello.resume_buffer_bytes =
      fields.number<std::uint32_t>(key::resume_buffer_bytes, "resume buffer", kResumeBufferDefault);
  hello.former = NodeId{fields.number<std::uint32_t>(key::former, "former id", 0)};
  hello.introduction = read_introduction(fields);
  return hello;
}

void Welcome::write(bitestream::Writer& writer) const {
  namespace key = welcome_key;
  writer.put_u32(key::node, node.value());
  writer.put_opaque(key::token, token);
  writer.put_u16(key::hub, hub.value());
  put_clean_text(writer, key::hub_name, hub_name, kNameBytesMax);
  writer.put_u64(key::epoch, epoch);
  writer.put_u32(key::frame_length_max, frame_length_max);
  writer.put_u64(key::features, features);
  writer.put_u32(key::keep_alive_ms, keep_alive_ms);
  writer.put_u32(key::silent_ms, silent_ms);
  writer.put_time(key::hub_time, hub_time_ns);
  writer.put_bool(key::resumed, resumed);
  writer.put_u64(key::taken, taken);
  writer.put_u32(key::resume_buffer_bytes, resume_buffer_bytes);
  writer.put_u32(key::grace_ms, grace_ms);
  if (last_goodbye_code != 0) writer.put_u16(key::last_goodbye_code, last_goodbye_code);
  put_clean_text(writer, key::last_goodbye_sentence, last_goodbye_sentence, kSentenceBytesMax);
  put_clean_text(writer, key::name, name, kNameBytesMax);
  if (retained_bytes_max) writer.put_u32(key::retained_bytes_max, *retained_bytes_max);
  if (introduction) write_introduction(writer, *introduction);
}

Welcome Welcome::read(Fields& fields) {
  namespace key = welcome_key;
  Welcome welcome;
  welcome.node = NodeId{fields.required_number<std::uint32_t>(key::node, "node id")};
  welcome.token = fields.opaque(key::token, "session token", kTokenBytesMax);
  welcome.hub = HubId{fields.required_number<std::uint16_t>(key::hub, "hub id")};
  welcome.hub_name = fields.text(key::hub_name, "hub name", kNameBytesMax);
  welcome.epoch = fields.number<std::uint64_t>(key::epoch, "epoch", 0);
  welcome.frame_length_max =
      fields.number<std::uint32_t>(key::frame_length_max, "largest frame", kFrameLengthDefault);
  welcome.features = fields.number<std::uint64_t>(key::features, "feature set", 0);
  welcome.keep_alive_ms =
      fields.number<std::uint32_t>(key::keep_alive_ms, "keep-alive interval", 0);
  welcome.silent_ms = fields.number<std::uint32_t>(key::silent_ms, "silent time", 0);
  welcome.hub_time_ns = fields.time(key::hub_time, "hub time");
  welcome.resumed = fields.flag(key::resumed, "resumed", false);
  welcome.taken = fields.number<std::uint64_t>(key::taken, "count of frames taken", 0);
  welcome.resume_buffer_bytes =
      fields.number<std::uint32_t>(key::resume_buffer_bytes, "resume buffer", 0);
  welcome.grace_ms = fields.number<std::uint32_t>(key::grace_ms, "grace time", 0);
  welcome.last_goodbye_code =
      fields.number<std::uint16_t>(key::last_goodbye_code, "last GOODBYE", 0);
  welcome.last_goodbye_sentence =
      fields.text(key::last_goodbye_sentence, "last sentence", kSentenceBytesMax);
  welcome.name = fields.text(key::name, "name", kNameBytesMax);
  if (fields.has(key::retained_bytes_max)) {
    welcome.retained_bytes_max =
        fields.number<std::uint32_t>(key::retained_bytes_max, "largest retained message", 0);
  }
  welcome.introduction = read_introduction(fields);
  return welcome;
}

const char* goodbye_name(GoodbyeCode code) {
  constexpr const char* kNames[kGoodbyeCount] = {
      "done",          "bad_version",  "malformed",   "hello_timeout",     "name_taken",
      "bad_name",      "hub_full",     "draining",    "replaced",          "silent",
      "slow_consumer", "wrong_source", "not_allowed", "too_many_requests", "stalled_frame",
      "kicked",        "no_memory",    "renumbered",  "oddities",          "id_taken",
      "copied"};
  const auto index = static_cast<std::size_t>(code);
  return index < kGoodbyeCount ? kNames[index] : "unknown";
}

void Goodbye::write(bitestream::Writer& writer) const {
  writer.put_u16(goodbye_key::code, static_cast<std::uint16_t>(code));
  put_clean_text(writer, goodbye_key::sentence, sentence, kSentenceBytesMax);
}

Goodbye Goodbye::read(Fields& fields) {
  Goodbye goodbye;
  goodbye.code =
      static_cast<GoodbyeCode>(fields.required_number<std::uint16_t>(goodbye_key::code, "code"));
  goodbye.sentence = fields.text(goodbye_key::sentence, "sentence", kSentenceBytesMax);
  return goodbye;
}

}  // namespace gimnet::proto
