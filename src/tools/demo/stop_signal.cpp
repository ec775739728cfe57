#include "tools/demo/stop_signal.hpp"

#include <unistd.h>

#include <csignal>
#include <initializer_list>

namespace gimnet::demo {
namespace {

volatile std::sig_atomic_t signal_received = 0;
unsigned patience = 0;

// alarm() is one of the calls that POSIX allows in a signal handler.
extern "C" void remember(int signal) {
  signal_received = signal;
  ::alarm(patience);
}

}  // namespace

void remember_stop_signals(unsigned patience_s) {
  patience = patience_s;
  struct sigaction action{};
  action.sa_handler = remember;
  sigemptyset(&action.sa_mask);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ::sigaction(signal, &action, nullptr);
  action.sa_handler = SIG_IGN;
  ::sigaction(SIGPIPE, &action, nullptr);
}

int stop_signal() { return signal_received; }

}  // namespace gimnet::demo
