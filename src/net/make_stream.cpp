#include "net/socket_stream.hpp"

namespace gimnet::net {

std::unique_ptr<Stream> make_stream(int descriptor, SocketStream::Family family,
                                    const SocketOptions& options) {
  return std::make_unique<SocketStream>(descriptor, family, options);
}

}  // namespace gimnet::net
