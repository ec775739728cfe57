#include "tools/gimnet/loss_words.hpp"

#include <string_view>

#include "gimnet/gimi.hpp"

namespace gimnet::tool {

std::string loss_words(std::string loss, const std::string& target) {
  constexpr std::string_view kNobody = "no node has that id";
  const std::size_t at = loss.find(kNobody);
  if (at != std::string::npos && !Peer::parse(target)) loss.replace(at, kNobody.size(), target + " has left");
  return loss;
}

}  // namespace gimnet::tool
