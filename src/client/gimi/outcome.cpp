#include "gimnet/gimi/outcome.hpp"

namespace gimnet {

std::string_view status_text(Status status) {
  switch (status) {
    case Status::timeout:
      return "timeout";
    case Status::closed:
      return "closed";
    case Status::bad_argument:
      return "bad argument";
    case Status::no_hub:
      return "no hub";
    case Status::no_host:
      return "unknown host";
    case Status::not_connected:
      return "not connected";
    case Status::bad_version:
      return "bad version";
    case Status::name_taken:
      return "name taken";
    case Status::bad_name:
      return "bad name";
    case Status::refused:
      return "refused";
    case Status::not_found:
      return "not found";
    case Status::taken:
      return "taken";
    case Status::denied:
      return "denied";
    case Status::limit:
      return "limit reached";
    case Status::too_large:
      return "too large";
    case Status::not_delivered:
      return "not delivered";
    case Status::window_full:
      return "window full";
    case Status::protocol:
      return "protocol error";
    case Status::system:
      return "system error";
    case Status::forked:
      return "forked";
    case Status::not_retained:
      return "not retained";
  }
  return "unknown status";
}

}  // namespace gimnet
