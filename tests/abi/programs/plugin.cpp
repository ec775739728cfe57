#include <cstdio>
#include <exception>

#include "use.hpp"

/// Called by the program that loads this plugin. 0: all went well.
extern "C" int run_plugin(const char* hub) {
  try {
    use_gimnet(hub, "plugin");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "not as it was: %s\n", error.what());
    return 1;
  }
  return 0;
}
