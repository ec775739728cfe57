#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace gimnet {

/// Takes the place of standard input, output and error where the process was started without them
/// (`<&- >&- 2>&-`, some supervisors): the next file or socket would get that number, and what is
/// meant for a person would be written into it. What stands there refuses reading and writing
/// (EBADF), so that a program that needs the stream says so. First thing in main(), before threads.
/// Without the memory or rights for /dev/null nothing is done.
void hold_standard_descriptors();

/// A write beyond the process's limit on the size of files (RLIMIT_FSIZE) fails with EFBIG, and one
/// to a pipe that nobody reads with EPIPE, instead of ending the process without a word. In main(),
/// before threads.
void have_failed_writes_told();

/// The treatment of a text for which a non-blocking stream has no room now. A blocking stream
/// always waits. The program that started this process decides which it is, often without knowing:
/// a pipe or terminal may be shared with another process.
enum class WhenFull : std::uint8_t { wait, fail };

/// Writes all of `text`. 0: done; else the errno (EAGAIN: there was no room; a part may have been
/// written).
[[nodiscard]] int write_all(int descriptor, std::string_view text,
                            WhenFull when_full = WhenFull::wait);

/// Writes all of `text` to standard output at once. Empty: done, or the reader went away, which is
/// no failure (EPIPE); else why it could not be written.
[[nodiscard]] std::string write_standard_output(std::string_view text,
                                                WhenFull when_full = WhenFull::wait);

}  // namespace gimnet
