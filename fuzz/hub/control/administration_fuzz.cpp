// HubCtrl: every request of section 9 of docs/protocol.md, by those who may and those who may not,
// among joins, leaves and services, in any order, through the hub's control library, compared after
// each with a reference of maps: who may, what follows, that no id is given twice, and that a node
// which was kicked has no token any more. Input: a byte that chooses the limits, then operations of
// {u8 which, ...}.

#include <cstddef>
#include <cstdint>

#include "fuzz/hub/control/support/control_run.hpp"

namespace {

using namespace gimnet;

void step(fuzz::ControlRun& run, fuzz::Choices& input) {
  switch (input.below(12)) {
    case 0:
    case 1:
    case 2:
      return run.join(input);
    case 3:
      return run.end(input);
    case 4:
      return run.pass(input);
    case 5:
      return run.ask_names(input);
    case 6:
      return run.ask_services(input);
    case 7:
      return run.ask_watches(input);
    case 8:
      return run.ask_control(input);
    case 9:
      // Rarely, since nobody joins any more.
      return input.below(16) == 0 ? run.drain() : run.serve(input);
    case 10:
      return run.ask_anything(input);
    default:
      return run.administer(input);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::ControlRun::of_input(data, size, step);
  return 0;
}
