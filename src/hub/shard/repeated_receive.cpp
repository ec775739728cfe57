#include "hub/shard/repeated_receive.hpp"

namespace gimnet::hub {

std::size_t receive_more(Connection& connection, std::span<std::byte> room, Tally& tally) {
  std::size_t bytes = 0;
  for (int reads = 0; reads < kReadsMore && bytes < std::min(kSmallReadBytes, room.size());
       ++reads) {
    const net::IoResult more = connection.transport->receive(room.subspan(bytes));
    ++tally.receive_calls;
    if (more.status != net::IoStatus::ok) break;
    bytes += more.bytes;
  }
  if (bytes != 0) {
    connection.read_again.succeeded();
  } else {
    connection.read_again.failed();
  }
  return bytes;
}

}  // namespace gimnet::hub
