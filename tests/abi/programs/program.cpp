// A program in C++20 with a plugin. Program and plugin are kept as they were compiled for a
// version, and each must run with later ones of the other, and with later libraries.
//
//     program HUB PLUGIN

#include <dlfcn.h>

#include <cstdio>
#include <exception>

#include "use.hpp"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  try {
    const gimnet::Node node("program", argv[1]);
    void* const plugin = ::dlopen(argv[2], RTLD_NOW);
    expect(plugin != nullptr, "the plugin is loaded");
    const auto run = reinterpret_cast<int (*)(const char*)>(::dlsym(plugin, "run_plugin"));
    expect(run != nullptr && run(argv[1]) == 0, "the plugin runs");
    use_gimnet(argv[1], "kept");
    expect(node.state().connected, "the node of the program is there");
    ::dlclose(plugin);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "not as it was: %s\n", error.what());
    return 1;
  }
  std::puts("all is as it was");
}
