#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

// Requests and their errors in GIMI messages (docs/protocol.md, section 7). Thread safety: value
// types and pure functions.

namespace gimnet::proto::gimi {

/// The message type of a service that answers requests; its instance tells it from others of its
/// node.
inline constexpr std::uint32_t kRequestType = 0x54534551;  // "QEST"

/// In the header's flags of a REQUEST: it was sent before, and may have come.
inline constexpr std::uint8_t kFlagAgain = 0x04;
/// The same: it may be done twice.
inline constexpr std::uint8_t kFlagRepeat = 0x08;

/// Before the data of a REQUEST: the milliseconds that are left to answer it.
inline constexpr std::size_t kRequestPrefix = 4;
inline constexpr std::uint32_t kNoDeadline = UINT32_MAX;

/// The data of a REQUEST. Valid until: its bytes change.
struct RequestBody {
  std::uint32_t left_ms = kNoDeadline;
  std::span<const std::byte> data;  ///< the application's
};
/// Nothing: too short.
[[nodiscard]] std::optional<RequestBody> decode_request(std::span<const std::byte> data);

/// Why a request has no reply.
enum class RequestFault : std::uint16_t {
  failed = 0x100,     ///< the program says so, with its own code
  busy = 0x101,       ///< too many requests wait for the program
  late = 0x102,       ///< the time was over before the program could take it
  let_go = 0x103,     ///< the program took it and does not answer it
  nobody = 0x104,     ///< no program answers there
  unknown = 0x105,    ///< it was sent before, and nobody knows what became of it
  withdrawn = 0x106,  ///< the service ended before the program could take it
  too_large = 0x107,  ///< than the other node takes
};

/// Data of an ERROR that answers a REQUEST. Valid until: its bytes change.
struct RequestError {
  RequestFault fault = RequestFault::failed;
  std::int32_t code = 0;  ///< the program's own, of `failed`
  std::string_view sentence;
};
/// Nothing: too short.
[[nodiscard]] std::optional<RequestError> decode_request_error(std::span<const std::byte> data);
[[nodiscard]] std::vector<std::byte> encode_request_error(const RequestError& error);

}  // namespace gimnet::proto::gimi
