#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "client/gimi/message.hpp"

namespace gimnet::test {

/// A message of a group that counts in a window of that epoch; with an epoch of 0 in none.
inline Message make_counted(std::uint32_t group, std::uint32_t epoch) {
  nif_incoming in{};
  in.kind = NIF_GROUP;
  in.to = group;
  in.epoch = epoch;
  return gimi::make_message(in, {}, nullptr, 0);
}

/// A message that NIF knows nothing of, of a service if one is named. `text` must outlive it.
inline Message make_message(std::string_view text, std::uint32_t sequence = 1, MessageKey key = {},
                            const std::string& service = "", std::uint32_t reconnects = 0,
                            nif_policy policy = NIF_POLICY_DEFAULT) {
  nif_incoming in{};
  in.from = (7u << 20) | 5;
  in.key = key.type | (static_cast<std::uint64_t>(key.instance) << 32);
  in.lane = 2;
  in.policy = static_cast<std::uint8_t>(policy);
  in.arrival_ns = 1000;
  proto::gimi::MessageView view;
  view.header.sequence = sequence;
  view.data = std::as_bytes(std::span(text.data(), text.size()));
  const gimi::OwnedServiceName name(service.empty() ? nullptr : new gimi::ServiceName(service));
  return gimi::make_message(in, view, name.get(), reconnects);
}

/// A message of so many bytes, which are nowhere, in that storage, of which it has a reference.
inline Message make_stored(std::size_t size, nif::Storage* storage) {
  nif_incoming in{};
  in.storage = storage;
  if (storage != nullptr) storage->add_reference();
  proto::gimi::MessageView view;
  static constexpr std::byte kNothing{};
  view.data = {&kNothing, size};
  return gimi::make_message(in, view, nullptr, 0);
}

}  // namespace gimnet::test
