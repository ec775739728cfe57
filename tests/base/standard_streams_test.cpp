#include "base/standard_streams.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/ioctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>

namespace gimnet {
namespace {

// In a process of its own: what it does to its descriptors and signals is nobody else's.
constexpr int kGood = 0;

int refuse_use() {
  char byte = 0;
  if (::read(STDIN_FILENO, &byte, 1) != -1 || errno != EBADF) return 2;
  if (::write(STDOUT_FILENO, &byte, 1) != -1 || errno != EBADF) return 3;
  return ::write(STDERR_FILENO, &byte, 1) == -1 && errno == EBADF ? kGood : 4;
}

int hold_those_that_are_missing() {
  for (const int number : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::close(number);
  hold_standard_descriptors();
  if (::open("/dev/null", O_RDWR | O_CLOEXEC) <= STDERR_FILENO) return 1;
  return refuse_use();
}

int leave_those_that_are_there() {
  std::array<int, 2> pipe{};
  if (::pipe2(pipe.data(), O_CLOEXEC) != 0 || ::dup2(pipe[1], STDOUT_FILENO) != STDOUT_FILENO)
    return 1;
  ::close(STDIN_FILENO);
  hold_standard_descriptors();
  if (!write_standard_output("here\n").empty()) return 2;
  std::array<char, 6> text{};
  if (::read(pipe[0], text.data(), text.size()) != 5) return 3;
  return std::string(text.data()) == "here\n" ? kGood : 4;
}

int write_beyond_the_limit_of_files(const std::string& file) {
  have_failed_writes_told();
  const rlimit limit{.rlim_cur = 4, .rlim_max = 4};
  if (::setrlimit(RLIMIT_FSIZE, &limit) != 0) return 1;
  const int descriptor = ::open(file.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
  if (::dup2(descriptor, STDOUT_FILENO) != STDOUT_FILENO) return 2;
  return write_standard_output("four and more") == "File too large" ? kGood : 3;
}

int write_to_a_reader_that_left() {
  have_failed_writes_told();
  std::array<int, 2> pipe{};
  if (::pipe2(pipe.data(), O_CLOEXEC) != 0 || ::dup2(pipe[1], STDOUT_FILENO) != STDOUT_FILENO)
    return 1;
  ::close(pipe[0]);
  return write_standard_output("unread").empty() ? kGood : 2;
}

/// More than fits into the pipe, which is read only when it is full.
int write_to_a_full_pipe_that_does_not_block(WhenFull when_full) {
  std::array<int, 2> pipe{};
  if (::pipe2(pipe.data(), O_CLOEXEC) != 0 || ::dup2(pipe[1], STDOUT_FILENO) != STDOUT_FILENO)
    return 1;
  if (::fcntl(STDOUT_FILENO, F_SETFL, O_NONBLOCK) != 0) return 2;
  ::close(pipe[1]);
  const int room = ::fcntl(pipe[0], F_SETPIPE_SZ, 4096);
  const std::string text(1'000'000, 'x');
  if (when_full == WhenFull::fail) {
    return write_standard_output(text, when_full) == "Resource temporarily unavailable" ? kGood : 3;
  }
  std::size_t got = 0;
  std::thread reader([&] {
    for (int waiting = 0; waiting < room;) static_cast<void>(::ioctl(pipe[0], FIONREAD, &waiting));
    std::array<char, 4096> bytes{};
    for (ssize_t count = 0; (count = ::read(pipe[0], bytes.data(), bytes.size())) > 0;) {
      got += static_cast<std::size_t>(count);
    }
  });
  const std::string why = write_standard_output(text, when_full);
  ::close(STDOUT_FILENO);
  reader.join();
  if (!why.empty()) return 4;
  return got == text.size() ? kGood : 5;
}

TEST(StandardStreams, MissingOnesAreHeldAndRefuseUse) {
  EXPECT_EXIT(::_exit(hold_those_that_are_missing()), testing::ExitedWithCode(kGood), "");
}

TEST(StandardStreams, ThoseThatAreThereAreLeftAlone) {
  EXPECT_EXIT(::_exit(leave_those_that_are_there()), testing::ExitedWithCode(kGood), "");
}

TEST(StandardStreams, AWriteBeyondTheLimitOfFilesIsToldInsteadOfEndingTheProcess) {
  const std::string file =
      testing::TempDir() + "standard_streams_test." + std::to_string(::getpid());
  EXPECT_EXIT(::_exit(write_beyond_the_limit_of_files(file)), testing::ExitedWithCode(kGood), "");
  std::filesystem::remove(file);
}

TEST(StandardStreams, AReaderThatLeftIsNoFailure) {
  EXPECT_EXIT(::_exit(write_to_a_reader_that_left()), testing::ExitedWithCode(kGood), "");
}

TEST(StandardStreams, OneThatDoesNotBlockIsWaitedFor) {
  EXPECT_EXIT(::_exit(write_to_a_full_pipe_that_does_not_block(WhenFull::wait)),
              testing::ExitedWithCode(kGood), "");
}

TEST(StandardStreams, OneThatDoesNotBlockIsNotWaitedForWhereNobodyWants) {
  EXPECT_EXIT(::_exit(write_to_a_full_pipe_that_does_not_block(WhenFull::fail)),
              testing::ExitedWithCode(kGood), "");
}

TEST(StandardStreams, AFullDiskIsTold) {
  EXPECT_EXIT(
      {
        const int full = ::open("/dev/full", O_WRONLY | O_CLOEXEC);
        ::dup2(full, STDOUT_FILENO);
        ::_exit(write_standard_output("text") == "No space left on device" ? kGood : 1);
      },
      testing::ExitedWithCode(kGood), "");
}

}  // namespace
}  // namespace gimnet
