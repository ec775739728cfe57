#pragma once

namespace gimnet::demo {

/// From now on SIGINT, SIGTERM and SIGHUP are remembered instead of ending the process, and SIGPIPE
/// is ignored. A process that has not ended so many seconds after a signal, because a call waits
/// for a hub that is gone, is ended by SIGALRM. Call once, at the start.
void remember_stop_signals(unsigned patience_s);

/// The signal that asked the process to stop; 0: none. Thread safety: any thread.
[[nodiscard]] int stop_signal();

}  // namespace gimnet::demo
