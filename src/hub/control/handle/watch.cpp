#include "hub/control/handle/watch.hpp"

#include "hub/control/state/watches.hpp"

namespace gimnet::hub {

namespace ns = proto::ns;

proto::Payload handle_watch(HandlerContext& context, const Request& request) {
  return answer_to<ns::Watch>(request, [&](const ns::Watch& wanted) {
    return context.watches.watch(request.session.index, wanted);
  });
}

proto::Payload handle_unwatch(HandlerContext& context, const Request& request) {
  return answer_to<ns::Unwatch>(
      request, [&](const ns::Unwatch& wanted) -> Result<ns::UnwatchAnswer, proto::Refusal> {
        const std::optional<proto::Refusal> failed =
            context.watches.unwatch(request.session.index, wanted.watch);
        if (failed) return *failed;
        return ns::UnwatchAnswer{};
      });
}

proto::Payload handle_watch_taken(HandlerContext& context, const Request& request) {
  return answer_to<ns::WatchTaken>(request, [&](const ns::WatchTaken& taken) {
    context.watches.taken(request.session.index, taken);
    return Result<ns::WatchTakenAnswer, proto::Refusal>(ns::WatchTakenAnswer{});
  });
}

}  // namespace gimnet::hub
