#include <algorithm>

#include "proto/control/ctrl.hpp"
#include "proto/control/names.hpp"
#include "proto/control/ns_register.hpp"
#include "proto/control/ns_watch.hpp"
#include "tests/sim/model.hpp"

// The answers that the reference model expects to questions.

namespace gimnet::sim {

using proto::Kind;
using proto::Status;
namespace ns = proto::ns;
namespace ctrl = proto::ctrl;

void Model::require_status(const Asked& asked, Status status, Checker checker) {
  const proto::Refusal said = proto::read_status(proto::split_control(asked.answer)->body);
  if (status != Status::done) census_.add(Happening::refused_request);
  if (said.status == status) return;
  broken(checker, "node " + std::to_string(asked.index) + "'s request of operation " +
                      std::to_string(proto::split_control(asked.payload)->header.operation) +
                      " is answered with " + proto::status_name(said.status) + " (" +
                      said.sentence + ") instead of " + proto::status_name(status));
}

void Model::asked(const hub::ControlFrameEvent& event, const hub::SendControlCommand* answer,
                  bool closed, milliseconds now) {
  if (known(event.session, event.node) == nullptr) {
    return require(answer == nullptr, Checker::answers,
                   "a request of a session that is over is answered");
  }
  const std::uint32_t index = present(index_of(event.node));
  if (sessions_.at(index).attachment != event.attachment) {
    census_.add(Happening::request_of_replaced_connection);
    return require(answer == nullptr, Checker::answers,
                   "a request of a connection that was replaced is answered");
  }
  const Kind kind = proto::load_header(event.frame.data()).kind;
  const auto payload = std::span{event.frame}.subspan(proto::kHeaderSize);
  const auto view = proto::split_control(payload);
  if (!view || (kind != Kind::ns && kind != Kind::ctrl)) {
    census_.add(Happening::garbled_request);
    return require(answer == nullptr, Checker::answers, "what is no request is answered");
  }
  require(answer != nullptr && answer->answers == 1, Checker::answers,
          "a request is not answered once");
  const auto said = std::span{answer->frame}.subspan(proto::kHeaderSize);
  const auto said_view = proto::split_control(said);
  require(said_view && said_view->header.request == view->header.request &&
              said_view->header.operation == (view->header.operation | proto::kAnswerBit),
          Checker::answers, "an answer is not to the request");
  require(answer->session.generation == event.session.generation &&
              answer->session.slot == event.session.slot && answer->attachment == event.attachment,
          Checker::answers, "an answer is not for the connection that asked");
  const Asked asked{index, sessions_.at(index), payload, said, now};
  const Status status = proto::read_status(said_view->body).status;
  if (status == Status::bad_request || status == Status::not_supported ||
      status == Status::denied) {
    const bool one_too_many =
        !asked.session.oddities.spend(limits_.oddities_per_s, limits_.oddities_burst, now);
    if (one_too_many) census_.add(Happening::asked_too_often_in_vain);
    require(closed == one_too_many, Checker::limits,
            "the limit on requests of no use does not hold");
  }
  if (kind == Kind::ctrl) return judge_control(asked, view->header.operation);
  judge_names(asked, view->header.operation);
}

void Model::judge_names(const Asked& asked, std::uint16_t operation) {
  if (operation == ns::Resolve::kOperation) {
    const auto wanted = proto::decode<ns::Resolve>(asked.payload);
    if (!wanted) return require_status(asked, Status::bad_request, Checker::answers);
    const auto found = names_.find(wanted->name);
    if (found == names_.end()) return require_status(asked, Status::not_found, Checker::names);
    require_status(asked, Status::done, Checker::names);
    require(proto::decode_answer<ns::ResolveAnswer>(asked.answer)->node == id(found->second),
            Checker::names, "RESOLVE names another node than the owner");
  } else if (operation == ns::Reverse::kOperation) {
    const auto wanted = proto::decode<ns::Reverse>(asked.payload);
    if (!wanted) return require_status(asked, Status::bad_request, Checker::answers);
    const std::uint32_t index = index_of(wanted->node);
    if (index == kHubIndex) return require_status(asked, Status::done, Checker::answers);
    const auto found = sessions_.find(index);
    if (found == sessions_.end()) return require_status(asked, Status::not_found, Checker::answers);
    require_status(asked, Status::done, Checker::answers);
    require(proto::decode_answer<ns::ReverseAnswer>(asked.answer)->name == found->second.name,
            Checker::names, "REVERSE says another name than the node has");
  } else if (operation == ns::RegisterName::kOperation) {
    judge_register(asked);
  } else if (operation == ns::UnregisterName::kOperation) {
    judge_unregister(asked);
  } else if (operation == ns::List::kOperation) {
    judge_list(asked);
  } else {
    judge_services(asked, operation);
  }
}

void Model::judge_services(const Asked& asked, std::uint16_t operation) {
  switch (operation) {
    case ns::Advertise::kOperation:
      return judge_advertise(asked);
    case ns::Withdraw::kOperation:
      return judge_withdraw(asked);
    case ns::Subscribe::kOperation:
      return judge_subscribe(asked);
    case ns::Unsubscribe::kOperation:
      return judge_unsubscribe(asked);
    case ns::ServicesRequest::kOperation:
      return judge_service_list(asked);
    case ns::Watch::kOperation:
      return judge_watch(asked);
    case ns::Unwatch::kOperation:
      return judge_unwatch(asked);
    case ns::WatchTaken::kOperation:
      return require_status(
          asked, proto::decode<ns::WatchTaken>(asked.payload) ? Status::done : Status::bad_request,
          Checker::answers);
    default:
      census_.add(Happening::unknown_operation);
      require_status(asked, Status::not_supported, Checker::answers);
  }
}

void Model::judge_control(const Asked& asked, std::uint16_t operation) {
  switch (operation) {
    case ctrl::HubInfo::kOperation: {
      require_status(asked, Status::done, Checker::answers);
      const auto answer = proto::decode_answer<ctrl::HubInfoAnswer>(asked.answer);
      return require(answer->nodes == sessions_.size() && answer->services == provided(),
                     Checker::answers, "HUB_INFO counts wrongly");
    }
    case ctrl::Statistics::kOperation:
      return require_status(asked, Status::done, Checker::answers);
    case ctrl::Connections::kOperation:
      return judge_connections(asked);
    case ctrl::Kick::kOperation:
    case ctrl::Reassign::kOperation:
    case ctrl::Drain::kOperation:
    case ctrl::Reload::kOperation:
      return judge_admin(asked, operation);
    default:
      census_.add(Happening::unknown_operation);
      require_status(asked, Status::not_supported, Checker::answers);
  }
}

namespace {

/// A page speaks of all up to this index.
template <class Answer>
std::uint32_t last_of_page(const Answer& answer) {
  return answer.more ? index_of(answer.next) : UINT32_MAX;
}

/// The most records that a page may have.
std::size_t page_size(const hub::Limits& limits, std::uint32_t wanted) {
  return std::clamp<std::size_t>(wanted, 1, limits.page_records);
}

}  // namespace

void Model::judge_list(const Asked& asked) {
  const auto wanted = proto::decode<ns::List>(asked.payload);
  const bool legal = wanted && (wanted->pattern.empty() || proto::valid_pattern(wanted->pattern));
  if (!legal) return require_status(asked, Status::bad_request, Checker::answers);
  require_status(asked, Status::done, Checker::answers);
  const auto answer = proto::decode_answer<ns::ListAnswer>(asked.answer);
  const std::size_t room = page_size(limits_, wanted->records_max);
  require(answer->nodes.size() <= room, Checker::limits,
          "LIST is answered with more records than a page has");
  auto record = answer->nodes.begin();
  const std::uint32_t last = last_of_page(*answer);
  for (auto entry = sessions_.upper_bound(index_of(wanted->after));
       entry != sessions_.end() && entry->first <= last; ++entry) {
    const Session& session = entry->second;
    if (!wanted->pattern.empty() && !proto::matches(wanted->pattern, session.name)) continue;
    if (wanted->connected_only && !session.connected) continue;
    require(record != answer->nodes.end(), Checker::answers, "LIST leaves out a node");
    require(
        record->node == id(entry->first) && record->name == session.name &&
            record->connected == session.connected && record->description == session.description &&
            record->place == session.place && record->services == session.provides.size() &&
            record->joined_ms == static_cast<std::uint64_t>((asked.now - session.joined).count()),
        Checker::answers, "LIST says of a node what is not so");
    ++record;
  }
  require(record == answer->nodes.end(), Checker::answers, "LIST has a node too many");
  require(!answer->more || last > index_of(wanted->after), Checker::answers,
          "LIST does not get on");
  if (answer->more) census_.add(Happening::page_continued);
}

void Model::judge_service_list(const Asked& asked) {
  const auto wanted = proto::decode<ns::ServicesRequest>(asked.payload);
  const bool legal = wanted && (wanted->pattern.empty() || proto::valid_pattern(wanted->pattern));
  if (!legal) return require_status(asked, Status::bad_request, Checker::answers);
  require_status(asked, Status::done, Checker::answers);
  const auto answer = proto::decode_answer<ns::ServicesAnswer>(asked.answer);
  const std::size_t room = page_size(limits_, wanted->records_max);
  require(answer->services.size() <= room, Checker::limits,
          "SERVICES is answered with more records than a page has");
  auto record = answer->services.begin();
  const std::uint32_t last = last_of_page(*answer);
  for (auto entry = groups_.upper_bound(index_of(wanted->after));
       entry != groups_.end() && entry->first <= last; ++entry) {
    const auto& [full_name, topic] = *entry->second;
    const Service& service = *topic.service;
    if (!service.provided()) continue;
    if (!wanted->pattern.empty() && !proto::matches(wanted->pattern, full_name)) continue;
    require(record != answer->services.end(), Checker::answers, "SERVICES leaves out a service");
    require(record->group == group_id(entry->first) && record->name == full_name &&
                record->node == id(service.provider) &&
                record->message_type == service.terms.message_type &&
                record->instance == service.terms.instance &&
                record->delivery == service.terms.delivery &&
                record->metadata == service.terms.metadata &&
                record->subscribers == topic.subscribers.size() &&
                record->window == window_of(service.terms) &&
                record->retain == service.terms.retain,
            Checker::answers, "SERVICES says of a service what is not so");
    ++record;
  }
  require(record == answer->services.end(), Checker::answers, "SERVICES has a service too many");
  require(!answer->more || last > index_of(wanted->after), Checker::answers,
          "SERVICES does not get on");
}

void Model::judge_connections(const Asked& asked) {
  const auto wanted = proto::decode<ctrl::Connections>(asked.payload);
  if (!wanted) return require_status(asked, Status::bad_request, Checker::answers);
  require_status(asked, Status::done, Checker::answers);
  const auto answer = proto::decode_answer<ctrl::ConnectionsAnswer>(asked.answer);
  const std::size_t room = page_size(limits_, wanted->records_max);
  require(answer->connections.size() <= room, Checker::limits,
          "CONNECTIONS is answered with more records than a page has");
  auto entry = sessions_.upper_bound(index_of(wanted->after));
  for (const ctrl::ConnectionRecord& record : answer->connections) {
    require(entry != sessions_.end() && record.node == id(entry->first) &&
                record.name == entry->second.name && record.connected == entry->second.connected &&
                record.peer == entry->second.place,
            Checker::answers, "CONNECTIONS says of a node what is not so");
    ++entry;
  }
  require(answer->more == (entry != sessions_.end()) &&
              (answer->more ? answer->connections.size() == room : true),
          Checker::answers, "CONNECTIONS is wrong about there being more");
}

}  // namespace gimnet::sim
