#include "hub/control/log_peer.hpp"

#include <arpa/inet.h>
#include <netinet/in.h>

#include <algorithm>
#include <array>
#include <cstdint>

#include "base/log.hpp"

namespace gimnet::hub {

std::string remote_address(std::string_view transport, std::string_view address) {
  if (transport != "tcp") return {};
  std::string host{log_peer(transport, address)};
  if (host.starts_with('[')) {
    in6_addr parsed{};
    // A link-local address may end with its interface: fe80::1%eth0.
    const std::string digits = host.substr(1, host.find_first_of("%]") - 1);
    if (::inet_pton(AF_INET6, digits.c_str(), &parsed) != 1) return host;
    if (IN6_IS_ADDR_LOOPBACK(&parsed)) return {};
    std::array<char, INET6_ADDRSTRLEN> text{};
    if (IN6_IS_ADDR_V4MAPPED(&parsed)) {
      ::inet_ntop(AF_INET, &parsed.s6_addr[12], text.data(), text.size());
      host = text.data();
    } else if (!IN6_IS_ADDR_LINKLOCAL(&parsed)) {  // all neighbours share that network
      std::fill_n(&parsed.s6_addr[8], 8, std::uint8_t{0});
      ::inet_ntop(AF_INET6, &parsed, text.data(), text.size());
      return std::string{text.data()} + "/64";
    }
  }
  return host.starts_with("127.") ? std::string{} : host;
}

void log_refused(NodeId link, const proto::FrameHeader& header) {
  const std::string neighbour = std::to_string(hub_of(link).value());
  const std::string source = std::to_string(hub_of(NodeId{header.src}).value());
  log_line(LogLevel::warning, {"dropped of link", neighbour},
           "link to hub " + neighbour + ": dropped a frame of kind " +
               std::to_string(static_cast<unsigned>(header.kind)) + " whose source is at hub " +
               source + ": that link may not speak for hub " + source +
               " (`allow` in docs/operations.md), or the frame is malformed; "
               "`gimnet status --json` counts both");
}

void log_malformed(const RouteMessage& message, std::chrono::milliseconds now) {
  log_seldom(LogLevel::warning, {"malformed", message.link},
             "link " + message.link + " to " + message.peer +
                 ": sent a malformed message (ROUTE, operation " +
                 std::to_string(message.operation) +
                 "), which is ignored; links.malformed in `gimnet status` counts them",
             now);
}

void log_seldom(LogLevel level, const LogSubject& subject, const std::string& text,
                std::chrono::milliseconds now) {
  thread_local LogThrottle throttle;
  constexpr int kSeldomS = 10;
  // The throttle counts lines a second: its second takes ten.
  const LogThrottle::Verdict verdict =
      throttle.take(subject.reason, subject.peer, 1, now / kSeldomS);
  if (!verdict.write) return;
  const std::string left_out = verdict.left_out == 0 ? ""
                                                     : " (" + std::to_string(verdict.left_out) +
                                                           " lines like this were left out)";
  log_line(level, subject, text + left_out);
}

}  // namespace gimnet::hub
