#include "hub/control/goodbye.hpp"

#include <array>

#include "hub/shard/control_frame.hpp"

namespace gimnet::hub {

bool send_goodbye(net::Stream& transport, proto::GoodbyeCode code, std::string_view sentence) {
  const std::vector<std::byte> frame =
      control_frame(proto::Kind::link, NodeId{0}, kOwnHub,
                    proto::encode(proto::Goodbye{code, std::string{sentence}}));
  const std::array<iovec, 2> pieces{
      iovec{const_cast<std::byte*>(proto::kOpening.data()), proto::kOpening.size()},
      iovec{const_cast<std::byte*>(frame.data()), frame.size()}};  // send() only reads them
  return transport.send(pieces).status == net::IoStatus::ok;
}

}  // namespace gimnet::hub
