#include "tools/gimnet/vanished_services.hpp"

#include <utility>

namespace gimnet::tool {

void VanishedServices::judge(const Gone& gone) {
  if (!gone.is_silent()) return;
  if (count_ == 0) first_ = gone.name;
  ++count_;
}

void VanishedServices::on_there(const std::string& name) {
  for (const Gone& gone : waiting_) {
    if (gone.name == name) judge(gone);
  }
  std::erase_if(waiting_, [&](const Gone& gone) { return gone.name == name; });
}

std::vector<std::string> VanishedServices::news(std::int64_t now_ns) {
  while (!waiting_.empty() && waiting_.front().due_ns <= now_ns) {
    judge(waiting_.front());
    waiting_.pop_front();
  }
  if (count_ == 0 || !pace_.due(now_ns)) return {};
  const std::size_t others = std::exchange(count_, 0) - 1;
  const std::string who = others == 0 ? first_
                                      : first_ + " and " + std::to_string(others) +
                                            (others == 1 ? " other" : " others");
  return {who + " came and went, and nothing came of " + (others == 0 ? "it" : "them") +
          ": what is published before this node has heard of a service and subscribed to it passes "
          "it by "
          "(`gimnet pub --wait 1` waits for that)"};
}

std::vector<std::string> VanishedServices::rest() {
  for (const Gone& gone : waiting_) judge(gone);
  waiting_.clear();
  pace_ = {};
  return news(0);
}

}  // namespace gimnet::tool
