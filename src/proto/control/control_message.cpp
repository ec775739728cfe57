#include "proto/control/control_message.hpp"

#include <cstring>

namespace gimnet::proto {

const char* status_name(Status status) {
  constexpr const char* kNames[kStatusCount] = {
      "done", "not_supported", "bad_request", "not_found", "taken", "denied", "limit", "rate"};
  const auto index = static_cast<std::size_t>(status);
  return index < kStatusCount ? kNames[index] : "unknown";
}

std::optional<ControlView> split_control(std::span<const std::byte> payload) {
  if (payload.size() < kControlHeaderSize) return std::nullopt;
  const ControlHeader header{load_le<std::uint16_t>(payload.data()),
                             load_le<std::uint16_t>(payload.data() + 2)};
  return ControlView{header, payload.subspan(kControlHeaderSize)};
}

Payload assemble_control(ControlHeader header, const bitestream::Writer& body) {
  // The structs write within the limits of Bitestream; anything else is a mistake in this program.
  GIMNET_CHECK(body.finish() == BITESTREAM_OK);
  Payload payload(kControlHeaderSize + body.size());
  store_le(payload.data(), header.operation);
  store_le(payload.data() + 2, header.request);
  if (body.size() != 0)
    std::memcpy(payload.data() + kControlHeaderSize, body.bytes().data(), body.size());
  return payload;
}

Payload encode_refusal(ControlHeader request, const Refusal& refusal) {
  bitestream::Writer body;
  body.put_u16(kStatusKey, static_cast<std::uint16_t>(refusal.status));
  put_clean_text(body, kSentenceKey, refusal.sentence, kSentenceBytesMax);
  if (refusal.learning) body.put_bool(kLearningKey, true);
  return assemble_control(
      {static_cast<std::uint16_t>(request.operation | kAnswerBit), request.request}, body);
}

Refusal read_status(std::span<const std::byte> body) {
  Fields fields(body, "answer");
  const auto status = fields.required_number<std::uint16_t>(kStatusKey, "status");
  std::string sentence = fields.text(kSentenceKey, "sentence", kSentenceBytesMax);
  if (fields.failed()) return {Status::bad_request, fields.error().sentence};
  Refusal refusal{static_cast<Status>(status), std::move(sentence)};
  // An answer that is none has other values under that key.
  if (refusal.status != Status::done)
    refusal.learning = fields.flag(kLearningKey, "learning", false);
  return refusal;
}

Status peek_status(std::span<const std::byte> payload) {
  const auto view = split_control(payload);
  if (!view) return Status::bad_request;
  bitestream::Reader reader(view->body);
  const auto first = reader.next();
  const auto status = first && first->key() == bitestream::Key(kStatusKey)
                          ? first->as<std::uint16_t>()
                          : std::nullopt;
  return status ? static_cast<Status>(*status) : Status::bad_request;
}

}  // namespace gimnet::proto
