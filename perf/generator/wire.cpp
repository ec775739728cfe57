#include "generator/wire.hpp"

#include "generator/frame_wire.hpp"
#include "generator/gimnet_wire.hpp"
#include "generator/mqtt_wire.hpp"
#include "generator/nats_wire.hpp"
#include "generator/resp_wire.hpp"
#include "generator/zmtp_wire.hpp"

namespace gimnet::perf {

std::unique_ptr<Wire> make_wire(std::string_view name) {
  if (name == "null") return std::make_unique<FrameWire>();
  if (name == "gimnet") return std::make_unique<GimnetWire>();
  if (name == "nats") return std::make_unique<NatsWire>();
  if (name == "mqtt") return std::make_unique<MqttWire>();
  if (name == "resp") return std::make_unique<RespWire>();
  if (name == "zmtp") return std::make_unique<ZmtpWire>();
  return nullptr;
}

}  // namespace gimnet::perf
