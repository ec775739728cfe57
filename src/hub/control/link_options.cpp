#include "hub/control/link_options.hpp"

#include <algorithm>

#include "base/log.hpp"
#include "hub/control/listen_url.hpp"
#include "proto/bitestream/utf8.hpp"
#include "proto/control/names.hpp"

namespace gimnet::hub {
namespace {

bool is_printable(std::string_view text) {
  const auto* bytes = reinterpret_cast<const unsigned char*>(text.data());
  const bool blank =
      std::ranges::any_of(text, [](unsigned char c) { return c <= ' ' || c == 0x7f; });
  return !blank && proto::bitestream::valid_utf8(bytes, text.size());
}

}  // namespace

bool is_link_name(std::string_view name) {
  return !name.empty() && name.size() <= proto::kNameBytesMax && is_printable(name);
}

Result<DialledLink> make_link(std::string_view url, std::string_view name) {
  if (url.size() > proto::kNameBytesMax || !is_printable(url)) {
    return Error{"cannot link to '" + escaped(url, kQuotedMax) + "': a URL has at most " +
                 std::to_string(proto::kNameBytesMax) +
                 " bytes, without spaces and control characters; write tcp://host:port or "
                 "unix:/path"};
  }
  const Result<net::Address, net::NetError> address = net::parse_address(url);
  if (!address) return Error{address.error().sentence};
  if (address->scheme == net::Address::Scheme::unix_socket && !address->path.starts_with('/')) {
    return Error{"cannot link to '" + std::string{url} +
                 "': the path would begin in the folder that the hub runs in; write unix:/path"};
  }
  if (!name.empty() && !is_link_name(name)) {
    return Error{"a link cannot have the name '" + escaped(name, kQuotedMax) + "': give at most " +
                 std::to_string(proto::kNameBytesMax) +
                 " bytes, without spaces and control characters"};
  }
  return DialledLink{.address = *address, .name = std::string{name.empty() ? url : name}};
}

bool is_local(const net::Address& address) {
  return address.scheme == net::Address::Scheme::unix_socket || address.host == "localhost" ||
         ListenUrl{{}, address.host, 0, {}}.is_local();
}

std::string not_encrypted(const net::Address& address, std::string_view word) {
  return "cannot link to " + address.url() +
         ": it is another machine, and nothing that is sent is encrypted; where all machines on "
         "the way are trusted give " +
         std::string{word} + ", otherwise link through a tunnel to 127.0.0.1";
}

}  // namespace gimnet::hub
