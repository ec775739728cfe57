#include "proto/control/names.hpp"
#include "proto/control/ns_register.hpp"
#include "proto/control/ns_watch.hpp"
#include "tests/sim/model.hpp"

// The reference model of requests about a node's own name, and of watching.

namespace gimnet::sim {

using proto::GoodbyeCode;
using proto::Status;
namespace ns = proto::ns;

void Model::judge_register(const Asked& asked) {
  const auto wanted = proto::decode<ns::RegisterName>(asked.payload);
  if (!wanted || wanted->name.empty())
    return require_status(asked, Status::bad_request, Checker::answers);
  const std::string& name = wanted->name;
  if (name != asked.session.name) {
    if (!may_declare(asked, Happening::names_rate))
      return require_status(asked, Status::rate, Checker::limits);
    const std::optional<GoodbyeCode> refusal = judge_name(name, asked.index);
    if (refusal == GoodbyeCode::bad_name)
      return require_status(asked, Status::bad_request, Checker::names);
    if (refusal) return require_status(asked, Status::taken, Checker::names);
  }
  require_status(asked, Status::done, Checker::names);
  const auto answer = proto::decode_answer<ns::RegisterNameAnswer>(asked.answer);
  require(answer.has_value() && answer->name == name, Checker::names,
          "REGISTER is answered with another name");
  census_.add(Happening::name_registered);
  renamed(asked, name, answer->token);
}

void Model::judge_unregister(const Asked& asked) {
  if (!proto::decode<ns::UnregisterName>(asked.payload)) {
    return require_status(asked, Status::bad_request, Checker::answers);
  }
  if (asked.session.name.empty()) return require_status(asked, Status::not_found, Checker::names);
  if (!may_declare(asked, Happening::names_rate))
    return require_status(asked, Status::rate, Checker::limits);
  require_status(asked, Status::done, Checker::names);
  const auto answer = proto::decode_answer<ns::UnregisterNameAnswer>(asked.answer);
  require(answer.has_value(), Checker::answers, "the answer to UNREGISTER cannot be read");
  census_.add(Happening::name_unregistered);
  renamed(asked, "", answer->token);
}

void Model::renamed(const Asked& asked, const std::string& name,
                    const std::vector<std::byte>& token) {
  if (name != asked.session.name) {
    const auto holder = name.empty() ? names_.end() : names_.find(name);
    if (holder != names_.end()) {
      census_.add(Happening::name_taken_over);
      end(holder->second, asked.now);
    }
    take_name(asked.index, name, asked.now);
    asked.session.token_name = name;
  }
  past_.tokens[token] = {asked.index, asked.session.token_number, asked.session.token_name,
                         asked.session.identity, asked.session.token_expiry};
}

void Model::judge_watch(const Asked& asked) {
  const auto wanted = proto::decode<ns::Watch>(asked.payload);
  const bool legal = wanted && wanted->watch != 0 &&
                     (wanted->pattern.empty() || proto::valid_pattern(wanted->pattern));
  if (!legal) return require_status(asked, Status::bad_request, Checker::answers);
  std::size_t all = 0;
  for (const auto& [index, session] : sessions_) all += session.watches.size();
  std::set<std::uint32_t>& own = asked.session.watches;
  const bool full = own.size() >= limits_.watches_per_node || all >= limits_.watches;
  if (full && !own.contains(wanted->watch)) {
    census_.add(Happening::watches_limit);
    return require_status(asked, Status::limit, Checker::limits);
  }
  require_status(asked, Status::done, Checker::limits);
  own.insert(wanted->watch);
  const auto answer = proto::decode_answer<ns::WatchAnswer>(asked.answer);
  require(answer.has_value(), Checker::answers, "the answer to WATCH cannot be read");
  if (!answer->snapshot) census_.add(Happening::watch_went_on);
}

void Model::judge_unwatch(const Asked& asked) {
  const auto wanted = proto::decode<ns::Unwatch>(asked.payload);
  if (!wanted) return require_status(asked, Status::bad_request, Checker::answers);
  const bool known = asked.session.watches.erase(wanted->watch) != 0;
  require_status(asked, known ? Status::done : Status::not_found, Checker::answers);
}

}  // namespace gimnet::sim
