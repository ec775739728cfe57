#include "tests/client/gimi/support/without_exceptions.hpp"

#include "gimnet/gimi.hpp"

#if defined(__cpp_exceptions)
#error "this file is for code without exceptions"
#endif

namespace gimnet::test {

int value_without_exceptions(bool is_there) {
  Outcome<int> outcome = Failure{Status::timeout, "there is no value"};
  if (is_there) outcome = 5;
  return outcome.value();
}

}  // namespace gimnet::test
