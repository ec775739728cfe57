#include "generator/wire.hpp"

#include "generator/frame_wire.hpp"
#include "generator/gimnet_wire.hpp"

namespace gimnet::perf {

std::unique_ptr<Wire> make_wire(std::string_view name) {
  if (name == "null") return std::make_unique<FrameWire>();
  if (name == "gimnet") return std::make_unique<GimnetWire>();
  return nullptr;
}

}  // namespace gimnet::perf
