#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/endian.hpp"
#include "base/result.hpp"
#include "proto/bitestream/writer.hpp"
#include "proto/control/fields.hpp"

// The common form of all payloads of kinds 16 and up: {u16 operation, u16 request number} and a
// Bitestream with integer keys (docs/protocol.md, sections 3, 8 and 9). The messages themselves are
// structs in link.hpp, ns.hpp and ctrl.hpp; each has
//
//     static constexpr std::uint16_t kOperation;            // with kAnswerBit for answers
//     static constexpr const char* kName;                   // for sentences
//     void write(bitestream::Writer&) const;
//     static Message read(Fields&);
//
// Thread safety: value types and pure functions. Errors: bytes from the network that are not the
// message give an Error with a sentence; unknown keys are skipped.

namespace gimnet::proto {

inline constexpr std::size_t kControlHeaderSize = 4;
inline constexpr std::uint16_t kAnswerBit = 0x8000;
/// Request number of events, and of everything in LINK frames.
inline constexpr std::uint16_t kNoRequest = 0;
/// Requests of one node that may be unanswered at every hub; one may be set to take more.
inline constexpr std::size_t kOpenRequestsMax = 64;

enum class Status : std::uint16_t {
  done = 0,
  not_supported = 1,
  bad_request = 2,
  not_found = 3,
  taken = 4,
  denied = 5,
  limit = 6,
  rate = 7,
};
inline constexpr std::size_t kStatusCount = 8;
/// The status as documents and tools print it, for example "not_found".
[[nodiscard]] const char* status_name(Status status);

/// The first 4 bytes of a control payload.
struct ControlHeader {
  std::uint16_t operation = 0;
  std::uint16_t request = kNoRequest;
  [[nodiscard]] constexpr bool is_answer() const { return (operation & kAnswerBit) != 0; }
  friend constexpr bool operator==(const ControlHeader&, const ControlHeader&) = default;
};

/// A control payload in two pieces. Valid until: the payload changes.
struct ControlView {
  ControlHeader header;
  std::span<const std::byte> body;
};
/// Nothing: fewer than 4 bytes.
[[nodiscard]] std::optional<ControlView> split_control(std::span<const std::byte> payload);

/// The payload of a control frame.
using Payload = std::vector<std::byte>;
[[nodiscard]] Payload assemble_control(ControlHeader header, const bitestream::Writer& body);

/// An answer that says no.
struct Refusal {
  Status status = Status::bad_request;
  std::string sentence;   ///< what happened, to what, and what to do
  bool learning = false;  ///< of RESOLVE: names of other hubs may be on their way
};
[[nodiscard]] Payload encode_refusal(ControlHeader request, const Refusal& refusal);

/// A request, an event, or a message of a LINK frame.
template <class Message>
[[nodiscard]] Payload encode(const Message& message, std::uint16_t request = kNoRequest) {
  static_assert((Message::kOperation & kAnswerBit) == 0, "use encode_answer()");
  bitestream::Writer body;
  message.write(body);
  return assemble_control({Message::kOperation, request}, body);
}

/// An answer with status `done`.
template <class Answer>
[[nodiscard]] Payload encode_answer(const Answer& answer, std::uint16_t request) {
  static_assert((Answer::kOperation & kAnswerBit) != 0, "use encode()");
  bitestream::Writer body;
  body.put_u16(kStatusKey, static_cast<std::uint16_t>(Status::done));
  answer.write(body);
  return assemble_control({Answer::kOperation, request}, body);
}

/// Reads a request, an event, or a message of a LINK frame; the operation is the caller's to have
/// looked at.
template <class Message>
[[nodiscard]] Result<Message> decode(std::span<const std::byte> payload) {
  const auto view = split_control(payload);
  if (!view)
    return Error{std::string(Message::kName) + ": shorter than an operation and a request number"};
  if (view->header.operation != Message::kOperation) {
    return Error{std::string(Message::kName) + ": has operation " +
                 std::to_string(view->header.operation)};
  }
  Fields fields(view->body, Message::kName);
  Message message = Message::read(fields);
  if (fields.failed()) return fields.error();
  return message;
}

/// Status and sentence of any answer; a body that cannot be read counts as refused with
/// `bad_request`.
[[nodiscard]] Refusal read_status(std::span<const std::byte> body);

/// The status of an answer that this side wrote, at the cost of one value. `bad_request`: it is no
/// answer.
[[nodiscard]] Status peek_status(std::span<const std::byte> payload);

/// Reads an answer. Refusal: the other side said no, or (bad_request) sent what cannot be read.
template <class Answer>
[[nodiscard]] Result<Answer, Refusal> decode_answer(std::span<const std::byte> payload) {
  if (const auto view = split_control(payload)) {
    if (Refusal refusal = read_status(view->body); refusal.status != Status::done) return refusal;
  }
  auto answer = decode<Answer>(payload);
  if (!answer) return Refusal{Status::bad_request, answer.error().sentence};
  return std::move(*answer);
}

}  // namespace gimnet::proto
