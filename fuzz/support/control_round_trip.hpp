#pragma once

#include "fuzz/support/fuzz_input.hpp"
#include "proto/control/control_message.hpp"

// Checks a rule of every control message: once read, it comes out the same after writing it.

namespace gimnet::fuzz {

/// Returns whether the payload could be read.
template <class Message>
bool check_message(std::span<const std::byte> payload) {
  const auto message = proto::decode<Message>(payload);
  if (!message) {
    FUZZ_MUST(!message.error().sentence.empty());
    return false;
  }
  const auto again = proto::decode<Message>(proto::encode(*message));
  FUZZ_MUST(again && *again == *message);
  return true;
}

/// Returns whether the payload could be read.
template <class Answer>
bool check_answer(std::span<const std::byte> payload) {
  const auto answer = proto::decode_answer<Answer>(payload);
  if (!answer) {
    FUZZ_MUST(answer.error().status != proto::Status::done);
    return false;
  }
  const auto again = proto::decode_answer<Answer>(proto::encode_answer(*answer, 1));
  FUZZ_MUST(again && *again == *answer);
  return true;
}

}  // namespace gimnet::fuzz
