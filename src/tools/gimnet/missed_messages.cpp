#include "tools/gimnet/missed_messages.hpp"

namespace gimnet::tool {

std::uint64_t MissedMessages::take(const Message& message) {
  const auto found = services_.find(message.service());
  auto& service = found != services_.end() ? found->second : services_[std::string(message.service())];
  const auto step = static_cast<std::int32_t>(message.sequence() - service.sequence);
  // The first of a provider says where it stands; a provider that began again counts from 1.
  if (message.from().id == service.provider && step > 1) {
    service.missed += static_cast<std::uint32_t>(step - 1);
    untold_ = true;
  }
  service.provider = message.from().id;
  service.sequence = message.sequence();
  return service.missed;
}

std::vector<std::string> MissedMessages::news(std::int64_t now_ns) {
  if (!untold_ || !pace_.due(now_ns)) return {};
  return rest();
}

std::vector<std::string> MissedMessages::rest() {
  std::vector<std::string> sentences;
  for (auto& [name, service] : services_) {
    if (service.told == service.missed) continue;
    service.told = service.missed;
    sentences.push_back(std::to_string(service.missed) + (service.missed == 1 ? " message of " : " messages of ") +
                        name + " did not come (this reader was too slow)");
  }
  untold_ = false;
  return sentences;
}

}  // namespace gimnet::tool
