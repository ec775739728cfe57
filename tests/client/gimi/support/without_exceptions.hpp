#pragma once

namespace gimnet::test {

/// The value() of an Outcome, in code that was compiled without exceptions.
int value_without_exceptions(bool is_there);

}  // namespace gimnet::test
