#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <variant>
#include <vector>

#include "hub/control/state/services.hpp"
#include "proto/control/ns.hpp"

// Services of nodes that only the test knows, and what changes of them bring about, in words.

namespace gimnet::hub::test {

using proto::Status;

inline constexpr NodeIndex kRobot{1};
inline constexpr NodeIndex kViewer{2};
inline constexpr NodeIndex kLogger{3};

inline ServiceTerms odometry() {
  ServiceTerms terms;
  terms.message_type = 5;
  terms.instance = 6;
  terms.delivery = proto::ns::Delivery::latest;
  return terms;
}

inline ServiceTerms commands() {
  ServiceTerms terms;
  terms.direction = proto::ns::Direction::accepts;
  return terms;
}

/// The terms that a paced subscriber is held to now.
inline std::string pace_text(const Topics& topics, const PaceDue& due) {
  const Topic* topic = topics.find_group(due.group);
  const auto pace = topic != nullptr ? topic->pace_of(due.subscriber) : std::nullopt;
  if (!pace) return "none";
  return std::to_string(pace->window) + "/" + std::to_string(pace->depth) +
         (topic->service->terms.retain ? " retained" : "") +
         (topic->once_plain.contains(due.subscriber) ? ", once plain" : "");
}

/// Effects as short words, in order: "group 1", "moved robot/odom", "subscribers robot/odom".
inline std::vector<std::string> words(const Effects& effects, const Topics& topics) {
  std::vector<std::string> result;
  for (const Effect& effect : effects) {
    if (const auto* group = std::get_if<GroupChanged>(&effect)) {
      result.push_back("group " + std::to_string(group->index.value()));
    } else if (const auto* member = std::get_if<MemberChanged>(&effect)) {
      result.push_back("member " + std::to_string(member->subscriber.value()) + " of " +
                       std::to_string(index_of(member->group)));
    } else if (const auto* moved = std::get_if<ServiceChanged>(&effect)) {
      result.push_back("moved " + moved->full_name + (moved->joins ? ", joins" : ""));
    } else if (const auto* change = std::get_if<SubscribersChanged>(&effect)) {
      result.push_back("subscribers " + change->full_name);
    } else if (const auto* pace = std::get_if<PaceDue>(&effect)) {
      result.push_back("pace " + std::to_string(pace->subscriber.value()) + " of " +
                       std::to_string(index_of(pace->group)) + ": " + pace_text(topics, *pace));
    } else if (const auto* ended = std::get_if<PaceEnded>(&effect)) {
      result.push_back("no pace " + std::to_string(ended->subscriber.value()) + " of " +
                       std::to_string(index_of(ended->group)));
    } else if (const auto* forgotten = std::get_if<RetainedDropped>(&effect)) {
      result.push_back("forget " + std::to_string(forgotten->group.value()) + " of " +
                       std::to_string(forgotten->provider.value()));
    } else if (const auto* accepting = std::get_if<AcceptanceChanged>(&effect)) {
      const Topic* topic = topics.find_group(accepting->group);
      const bool away = topic != nullptr && topic->service->provider_away;
      result.push_back((away ? "away " : "there ") + std::to_string(accepting->group.value()));
    } else if (!std::holds_alternative<ServiceNoted>(effect)) {  // those are for watches_test.cpp
      result.emplace_back("other");
    }
  }
  return result;
}

class ServicesTest : public ::testing::Test {
 protected:
  ServicesTest() {
    limits_.services_per_node = 2;
    limits_.subscriptions_per_node = 2;
  }
  GroupIndex advertise(NodeIndex node, const std::string& name,
                       const ServiceTerms& terms = odometry()) {
    const auto done = services_.advertise(node, name, terms, now_, effects_);
    return done ? done->group : kNoGroup;
  }
  Status advertise_failure(NodeIndex node, const std::string& name) {
    const auto done = services_.advertise(node, name, odometry(), now_, effects_);
    return done ? Status::done : done.error().status;
  }
  Status subscribe(NodeIndex node, const std::string& name) {
    const auto done = services_.subscribe(node, name, {}, effects_);
    return done ? Status::done : done.error().status;
  }
  std::vector<std::string> take_words() {
    std::vector<std::string> result = words(effects_, topics_);
    effects_.clear();
    return result;
  }

  Limits limits_;
  Topics topics_{HubId{7}, limits_};
  Services services_{topics_, limits_};
  Effects effects_;
  std::chrono::milliseconds now_{0};
};

}  // namespace gimnet::hub::test
