#include <algorithm>
#include <cmath>

#include "proto/control/names.hpp"
#include "tests/sim/model.hpp"

// Subscriptions of the reference model, and how much of a service each is owed.

namespace gimnet::sim {

using proto::Status;
namespace ns = proto::ns;

Status Model::judge_delivery(const ns::Advertise& offer) const {
  const bool counted = offer.delivery == ns::Delivery::sync;
  if (offer.direction == ns::Direction::accepts && (counted || offer.retain))
    return Status::bad_request;
  if (!counted && offer.window != 0) return Status::bad_request;
  return counted && offer.window > limits_.sync_window ? Status::bad_request : Status::done;
}

std::uint32_t Model::window_of(const ns::Advertise& terms) {
  return terms.delivery == ns::Delivery::sync ? std::max(1u, terms.window) : 0;
}

std::optional<Model::Terms> Model::pace_of(const Topic& topic, std::uint32_t subscriber) {
  if (!topic.service) return std::nullopt;
  const ns::Advertise& offer = topic.service->terms;
  const Subscriber& asked = topic.subscribers.at(subscriber);
  Terms terms = asked.terms;
  const std::uint32_t most = window_of(offer);
  if (terms.window == 0 || (most != 0 && most < terms.window)) terms.window = most;
  const bool bounded = terms.window != 0 || terms.interval_us != 0 || offer.retain;
  if (!bounded && !asked.once_paced) return std::nullopt;
  return terms;
}

bool Model::terms_fit(const ns::Subscribe& wanted) const {
  const double rate = wanted.rate_hz;
  const bool rate_fits =
      rate == 0.0 || (rate >= 0.001 && rate <= static_cast<double>(limits_.subscription_rate_hz));
  return wanted.window <= limits_.sync_window && wanted.depth >= 1 &&
         wanted.depth <= limits_.subscription_depth && rate_fits;
}

void Model::judge_subscribe(const Asked& asked) {
  const auto wanted = proto::decode<ns::Subscribe>(asked.payload);
  if (!wanted) return require_status(asked, Status::bad_request, Checker::answers);
  if (!terms_fit(*wanted)) {
    census_.add(Happening::delivery_refused);
    return require_status(asked, Status::bad_request, Checker::limits);
  }
  const double rate = wanted->rate_hz;
  const Terms terms{wanted->window, wanted->depth,
                    rate == 0.0 ? 0 : static_cast<std::uint32_t>(std::ceil(1e6 / rate)),
                    wanted->number};
  Session& session = asked.session;
  const bool fresh = !session.subscribes.contains(wanted->name);
  Terms repeated = fresh ? Terms{} : topics_.at(wanted->name).subscribers.at(asked.index).terms;
  repeated.number = terms.number;
  const bool said_before = !fresh && repeated == terms;
  if (!said_before && !may_declare(asked, Happening::subscriptions_rate)) {
    return require_status(asked, Status::rate, Checker::limits);
  }
  if (!proto::valid_name(wanted->name))
    return require_status(asked, Status::bad_request, Checker::answers);
  if (fresh && session.subscribes.size() >= limits_.subscriptions_per_node) {
    census_.add(Happening::subscriptions_limit);
    return require_status(asked, Status::limit, Checker::limits);
  }
  require_status(asked, Status::done, Checker::limits);
  session.subscribes[wanted->name] = session.life;
  Topic& topic = topics_[wanted->name];
  if (fresh) {
    topic.subscribers[asked.index].terms = terms;
    topic.unused_until.reset();
    resubscribed_.insert(wanted->name);
  } else {
    change_terms(topic, asked.index, terms);
  }
  if (topic.service) touched_.insert(topic.service->group);
  judge_subscribe_answer(asked, topic);
}

void Model::change_terms(Topic& topic, std::uint32_t index, const Terms& terms) {
  Subscriber& subscriber = topic.subscribers.at(index);
  const std::optional<Terms> before = pace_of(topic, index);
  subscriber.terms = terms;
  if (before && !pace_of(topic, index)) {
    subscriber.once_paced = true;
    census_.add(Happening::pace_given_up);
  }
  const std::optional<Terms> after = pace_of(topic, index);
  if (before && after != before) census_.add(Happening::pace_changed);
  if (before || !after) return;
  subscriber.once_plain = true;
  census_.add(Happening::pace_taken_up);
}

void Model::judge_subscribe_answer(const Asked& asked, const Topic& topic) {
  auto answer = proto::decode_answer<ns::SubscribeAnswer>(asked.answer);
  ns::SubscribeAnswer due;
  static_cast<ns::ServiceState&>(due) = state_of(topic, asked.index);
  due.number = topic.subscribers.at(asked.index).terms.number;
  if (answer) answer->session = 0;  // the hub's own number
  require(answer.has_value() && answer->group == due.group, Checker::answers,
          "SUBSCRIBE is answered with a wrong group");
  require(answer->window == due.window, Checker::pace,
          "SUBSCRIBE is answered with another window than is in force");
  require(*answer == due, Checker::answers,
          "SUBSCRIBE is answered with other terms than the provider's");
}

ns::ServiceState Model::state_of(const Topic& topic, std::uint32_t subscriber) const {
  ns::ServiceState state;
  if (!topic.service) return state;
  const ns::Advertise& terms = topic.service->terms;
  state.group = group_id(topic.service->group);
  if (topic.service->provided()) state.provider = id(topic.service->provider);
  state.message_type = terms.message_type;
  state.instance = terms.instance;
  state.delivery = terms.delivery;
  state.retain = terms.retain;
  state.direction = terms.direction;
  state.away = topic.service->away;
  if (const auto pace = pace_of(topic, subscriber)) state.window = pace->window;
  return state;
}

void Model::judge_unsubscribe(const Asked& asked) {
  const auto wanted = proto::decode<ns::Unsubscribe>(asked.payload);
  if (!wanted) return require_status(asked, Status::bad_request, Checker::answers);
  if (!asked.session.subscribes.contains(wanted->name)) {
    return require_status(asked, Status::not_found, Checker::answers);
  }
  require_status(asked, Status::done, Checker::answers);
  unsubscribe(asked.index, wanted->name, asked.now);
}

}  // namespace gimnet::sim
