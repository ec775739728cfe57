#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "proto/control/ns.hpp"

// The own name of a node, after it has joined (docs/protocol.md, section 8). As ns.hpp.

namespace gimnet::proto::ns {

// REGISTER: take that name, in place of the one that this node has

struct RegisterName {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::register_name);
  static constexpr const char* kName = "REGISTER";
  std::string name;
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static RegisterName read(Fields& fields);
  friend bool operator==(const RegisterName&, const RegisterName&) = default;
};

struct RegisterNameAnswer {
  static constexpr std::uint16_t kOperation = answer_of(NsOperation::register_name);
  static constexpr const char* kName = "answer to REGISTER";
  std::string name;              ///< as registered
  std::vector<std::byte> token;  ///< of the session, in place of the one of WELCOME
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static RegisterNameAnswer read(Fields& fields);
  friend bool operator==(const RegisterNameAnswer&, const RegisterNameAnswer&) = default;
};

// UNREGISTER: give the own name back, go on without one

struct UnregisterName {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::unregister_name);
  static constexpr const char* kName = "UNREGISTER";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static UnregisterName read(Fields&) { return {}; }
  friend bool operator==(const UnregisterName&, const UnregisterName&) = default;
};

struct UnregisterNameAnswer {
  static constexpr std::uint16_t kOperation = answer_of(NsOperation::unregister_name);
  static constexpr const char* kName = "answer to UNREGISTER";
  std::vector<std::byte> token;  ///< of the session, in place of the one before
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static UnregisterNameAnswer read(Fields& fields);
  friend bool operator==(const UnregisterNameAnswer&, const UnregisterNameAnswer&) = default;
};

// LET_GO: from hub to hub: end the session of that token, whose node is here now

struct LetGo {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::let_go);
  static constexpr const char* kName = "LET_GO";
  std::string name;                   ///< that the node asks for; "": none
  std::vector<std::byte> token;       ///< as the node showed it
  std::optional<std::uint32_t> user;  ///< of the node's Unix socket; nothing: it came over TCP
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static LetGo read(Fields& fields);
  friend bool operator==(const LetGo&, const LetGo&) = default;
};

struct LetGoAnswer {
  static constexpr std::uint16_t kOperation = answer_of(NsOperation::let_go);
  static constexpr const char* kName = "answer to LET_GO";
  void write(bitestream::Writer&) const {}
  [[nodiscard]] static LetGoAnswer read(Fields&) { return {}; }
  friend bool operator==(const LetGoAnswer&, const LetGoAnswer&) = default;
};

// Events

/// The name went to a node of another hub, which has the better claim: the node goes on without
/// one. Or it is the full name of a service of this node: that has ended.
struct NameLost {
  static constexpr std::uint16_t kOperation = request_of(NsOperation::name_lost);
  static constexpr const char* kName = "NAME_LOST";
  std::string name;
  NodeId holder;         ///< who has it now
  std::string sentence;  ///< why, for people
  void write(bitestream::Writer& writer) const;
  [[nodiscard]] static NameLost read(Fields& fields);
  friend bool operator==(const NameLost&, const NameLost&) = default;
};

}  // namespace gimnet::proto::ns
