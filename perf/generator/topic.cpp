#include "generator/topic.hpp"

#include "net/socket.hpp"

namespace gimnet::perf {

std::string topic_of(const Target& target) {
  if (target.kind == Target::Kind::unicast) return topic_of(*target.recipients.front());
  if (target.kind != Target::Kind::group)
    fail("this subject knows neither lists of recipients nor broadcast");
  return std::string{kGroupTopic};
}

}  // namespace gimnet::perf
