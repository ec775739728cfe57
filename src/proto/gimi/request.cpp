#include "proto/gimi/request.hpp"

#include <algorithm>

#include "base/endian.hpp"

namespace gimnet::proto::gimi {
namespace {

constexpr std::size_t kFixed = 6;

}  // namespace

std::optional<RequestBody> decode_request(std::span<const std::byte> data) {
  if (data.size() < kRequestPrefix) return std::nullopt;
  return RequestBody{load_le<std::uint32_t>(data.data()), data.subspan(kRequestPrefix)};
}

std::optional<RequestError> decode_request_error(std::span<const std::byte> data) {
  if (data.size() < kFixed) return std::nullopt;
  const auto words = data.subspan(kFixed);
  return RequestError{static_cast<RequestFault>(load_le<std::uint16_t>(data.data())),
                      load_le<std::int32_t>(data.data() + 2),
                      {reinterpret_cast<const char*>(words.data()), words.size()}};
}

std::vector<std::byte> encode_request_error(const RequestError& error) {
  std::vector<std::byte> data(kFixed + error.sentence.size());
  store_le(data.data(), static_cast<std::uint16_t>(error.fault));
  store_le(data.data() + 2, error.code);
  std::ranges::copy(std::as_bytes(std::span(error.sentence)), data.begin() + kFixed);
  return data;
}

}  // namespace gimnet::proto::gimi
