#include "net/socket_stream.hpp"
#include "tests/net/support/toy_stream.hpp"

// Linked into a test, this hides the library's make_stream(): with GIMNET_TEST_STREAM=toy each
// stream that the library dials is a toy.

namespace gimnet::net {

std::unique_ptr<Stream> make_stream(int descriptor, SocketStream::Family family,
                                    const SocketOptions& options) {
  auto socket = std::make_unique<SocketStream>(descriptor, family, options);
  if (!toy_streams_wanted()) return socket;
  return std::make_unique<LockedStream>(std::make_unique<ToyStream>(std::move(socket)));
}

}  // namespace gimnet::net
