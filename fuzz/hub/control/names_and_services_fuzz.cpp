// HubNS: joins, leaves, replaced connections, time and every request of section 8 of
// docs/protocol.md, in any order, through the hub's control library, compared after each with a
// reference of maps. Input: a byte that chooses the limits, then operations of {u8 which, ...}.

#include <cstddef>
#include <cstdint>

#include "fuzz/hub/control/support/control_run.hpp"

namespace {

using namespace gimnet;

void step(fuzz::ControlRun& run, fuzz::Choices& input) {
  switch (input.below(11)) {
    case 0:
    case 1:
      return run.join(input);
    case 2:
      return run.end(input);
    case 3:
      return run.pass(input);
    case 4:
      return run.serve(input);
    case 5:
      return run.ask_names(input);
    case 6:
    case 7:
      return run.ask_services(input);
    case 8:
      return run.ask_watches(input);
    case 9:
      return run.ask_anything(input);
    default:
      return run.ask_control(input);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::ControlRun::of_input(data, size, step);
  return 0;
}
