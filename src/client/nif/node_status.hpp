#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/mutex.hpp"
#include "client/nif/inbound.hpp"
#include "client/nif/session_terms.hpp"
#include "client/nif/token_store.hpp"
#include "gimnet/nif.h"

namespace gimnet::nif {

/// The answers to a program's questions about its node: the state of the connection, the last
/// trouble, the counts of what came, and the name, which calls of the program change and the
/// library's thread takes up. Thread safety: any thread.
class NodeStatus {
 public:
  [[nodiscard]] nif_info info() GIMNET_EXCLUDES(mutex_);
  [[nodiscard]] std::string last_error() GIMNET_EXCLUDES(mutex_);
  void set_last_error(std::string sentence) GIMNET_EXCLUDES(mutex_);
  void add_counters(nif_counters& counters) GIMNET_EXCLUDES(mutex_);

  // The connection, told by the library's thread.
  void connected(const SessionTerms& session, bool first) GIMNET_EXCLUDES(mutex_);
  void disconnected(const std::string& why, bool for_good) GIMNET_EXCLUDES(mutex_);
  /// No connection will come any more.
  void ended(bool replaced) GIMNET_EXCLUDES(mutex_);
  void took_token(const TokenStore& tokens) GIMNET_EXCLUDES(mutex_);
  void count_read(std::size_t bytes, const Inbound::Counts& counts) GIMNET_EXCLUDES(mutex_);

  // The name.
  struct NewName {
    std::string name;
    std::vector<std::byte> token;
  };
  /// The hub registered this node under another name, "" for none.
  void set_name(const std::string& name, std::vector<std::byte> token) GIMNET_EXCLUDES(mutex_);
  /// That begins with the own name and '/'.
  [[nodiscard]] bool is_own_service(const std::string& name) GIMNET_EXCLUDES(mutex_);
  /// The name that the library's thread has not seen to yet.
  [[nodiscard]] std::optional<NewName> take_new_name() GIMNET_EXCLUDES(mutex_);

 private:
  Mutex mutex_;
  nif_info info_ GIMNET_GUARDED_BY(mutex_){};
  std::string last_error_ GIMNET_GUARDED_BY(mutex_);
  Inbound::Counts counts_ GIMNET_GUARDED_BY(mutex_);
  std::uint64_t bytes_received_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::uint64_t read_calls_ GIMNET_GUARDED_BY(mutex_) = 0;
  std::optional<NewName> new_name_ GIMNET_GUARDED_BY(mutex_);  ///< given while connected
};

}  // namespace gimnet::nif
