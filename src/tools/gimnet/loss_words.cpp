#include "tools/gimnet/loss_words.hpp"

namespace gimnet::tool {

std::string loss_words(const SendCounts& counts, const std::string& target) {
  if (counts.loss_reason != LossReason::no_such_node || Peer::parse(target)) return counts.loss;
  return "the hub reports no_such_node: " + target + " has left";
}

}  // namespace gimnet::tool
