#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "gimnet/gimi.hpp"
#include "tests/stress/support/cutting_proxy.hpp"
#include "tests/stress/support/hub_process.hpp"
#include "tests/stress/support/size.hpp"
#include "tests/stress/support/socket.hpp"

// Requests from eight threads, while the program that answers is killed, started again and moved to
// another hub, a hub on the way is killed, and the connection of half of the threads is cut. Each
// request has a number. The program that answers writes the number into a file before it answers,
// so what was done can be compared with what each request said of itself. Provable is: each ends
// once and in time, with its own reply, and `ran` is never wrong; none is done twice unless it may
// be.

extern char** environ;

namespace gimnet::stress {
namespace {

constexpr std::uint64_t kThreads = 8;
constexpr std::uint64_t kFail = 1;    ///< number % kKinds: the program answers with an error
constexpr std::uint64_t kLetGo = 2;   ///< it does not answer
constexpr std::uint64_t kRepeat = 3;  ///< it may be done twice
constexpr std::uint64_t kKinds = 16;
constexpr std::int32_t kCode = 7;

std::uint64_t wanted_answers() { return is_full_size() ? 100'000 : 10'000; }
std::uint64_t answers_between_events() { return is_full_size() ? 2'000 : 1'000; }
/// A request ends at most so late. A test that runs beside others cannot be as strict.
std::chrono::milliseconds grace() { return std::chrono::milliseconds(is_full_size() ? 100 : 1000); }

/// Joins as often as a supervisor would start the program: while no link leads to the hub that its
/// predecessor was at, the hub keeps the predecessor's name and refuses.
Node join_in_the_end(const NodeOptions& options) {
  for (;;) {
    if (auto node = Node::join(options)) return std::move(*node);
    wait_readable({}, 20);
  }
}

/// The program that answers: does what each request asks for until it is killed.
int answer_requests(const char* hub, const char* file) {
  NodeOptions options;
  options.name = "calc";
  options.hub = hub;
  options.keep_token = false;
  const int done = ::open(file, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
  if (done < 0) return 1;
  const Node node = join_in_the_end(options);
  const Answers add = node.answer("add").or_throw();
  const auto work = [&] {
    for (;;) {
      auto request = add.receive();
      if (!request) return;
      std::uint64_t number = 0;
      std::memcpy(&number, request->data().data(), sizeof number);
      if (::write(done, &number, sizeof number) != sizeof number) ::abort();
      if (number % kKinds == kFail) static_cast<void>(request->fail(kCode, std::to_string(number)));
      if (number % kKinds > kLetGo || number % kKinds == 0)
        static_cast<void>(request->reply(std::string(request->text())));
    }
  };
  std::thread other(work);
  work();
  other.join();
  return 0;
}

/// That program, as a process of its own. Ends with this.
class Answering {
 public:
  explicit Answering(std::string file) : file_(std::move(file)) {}
  Answering(const Answering&) = delete;
  Answering& operator=(const Answering&) = delete;
  ~Answering() { kill(); }

  void start(const std::string& hub) {
    std::array<std::string, 4> words{"/proc/self/exe", "--answer", hub, file_};
    std::array<char*, 5> pointers{words[0].data(), words[1].data(), words[2].data(),
                                  words[3].data(), nullptr};
    if (::posix_spawn(&process_, words[0].c_str(), nullptr, nullptr, pointers.data(), environ) != 0)
      throw std::runtime_error("cannot start the program that answers");
  }
  void kill() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
    process_ = -1;
  }

 private:
  const std::string file_;
  pid_t process_ = -1;
};

/// The end of a request, as it was told.
struct Ending {
  std::uint64_t number = 0;
  Ran ran = Ran::no;
  Status status = Status::ok;
};

/// One of the threads that ask.
class Asker {
 public:
  Asker(const Node& node, std::uint64_t first) : node_(node), next_(first) {}

  void ask_until(const std::atomic<bool>& over, std::atomic<std::uint64_t>& answered) {
    while (!over) {
      ask();
      if (endings_.back().ran == Ran::yes) ++answered;
    }
  }
  [[nodiscard]] const std::vector<Ending>& endings() const { return endings_; }

 private:
  void ask() {
    const std::uint64_t number = next_;
    next_ += kThreads;
    const std::array<std::int64_t, 3> times{100, 300, 1000};
    const Timeout time{times[number / kKinds % times.size()]};
    std::string data(sizeof number, '\0');
    std::memcpy(data.data(), &number, sizeof number);
    const auto deadline = Clock::now() + time;
    const Reply reply =
        node_.request("calc/add", data, time, {.repeat = number % kKinds == kRepeat});
    EXPECT_LE(Clock::now(), deadline + grace()) << reply.failure().sentence;
    if (reply) {
      EXPECT_EQ(reply.text(), data) << "the reply to another request";
    }
    if (reply.is(Status::failed)) {
      EXPECT_EQ(reply.code(), kCode);
      EXPECT_EQ(reply.failure().sentence, "calc/add: " + std::to_string(number));
    }
    endings_.push_back({number, reply.ran(), reply.status()});
  }

  const Node& node_;
  std::uint64_t next_;
  std::vector<Ending> endings_;
};

std::map<std::uint64_t, std::uint64_t> times_done(const std::string& file) {
  std::map<std::uint64_t, std::uint64_t> times;
  std::ifstream in(file, std::ios::binary);
  for (std::uint64_t number = 0; in.read(reinterpret_cast<char*>(&number), sizeof number);)
    ++times[number];
  return times;
}

/// Compares with what was done. Returns how many there were of each status, in words.
std::string check(const std::vector<Asker>& askers, const std::string& file) {
  const auto times = times_done(file);
  std::map<std::pair<Status, Ran>, std::uint64_t> counts;
  for (const Asker& asker : askers) {
    for (const Ending& ending : asker.endings()) {
      ++counts[{ending.status, ending.ran}];
      const auto found = times.find(ending.number);
      const std::uint64_t done = found == times.end() ? 0 : found->second;
      if (ending.ran == Ran::no) {
        EXPECT_EQ(done, 0u) << static_cast<int>(ending.status);
      }
      if (ending.ran == Ran::yes) {
        EXPECT_GE(done, 1u) << static_cast<int>(ending.status);
      }
      if (ending.number % kKinds != kRepeat) {
        EXPECT_LE(done, 1u) << "done twice";
      }
    }
  }
  std::string words;
  for (const auto& [what, count] : counts) {
    words += std::string(status_text(what.first)) + ", ran " +
             std::to_string(static_cast<int>(what.second)) + ": " + std::to_string(count) + "\n";
  }
  return words;
}

TEST(Requests, EndOnceInTimeAndSayWhetherTheyWereDone) {
  std::string folder = (std::filesystem::temp_directory_path() / "gimnet-done-XXXXXX").string();
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  const std::string file = folder + "/done";
  HubProcess middle({"--hub-id", "1", "--accept-links"});
  const HubProcess near({"--hub-id", "2", "--link", middle.tcp_url()});
  const HubProcess far({"--hub-id", "3", "--link", middle.tcp_url()});
  CuttingProxy proxy(near.tcp_url(), {});
  Answering answering(file);
  answering.start(far.tcp_url());
  const Node named("asker", near.unix_url());
  const Node cut("", proxy.url());  // its session is not resumed

  std::atomic<bool> over = false;
  std::atomic<std::uint64_t> answered = 0;
  std::vector<Asker> askers;
  for (std::uint64_t i = 0; i < kThreads; ++i) askers.emplace_back(i % 2 == 0 ? named : cut, i);
  std::vector<std::thread> threads;
  for (Asker& asker : askers)
    threads.emplace_back([&asker, &over, &answered] { asker.ask_until(over, answered); });

  bool is_near = false;
  const auto restart = [&](bool moved) {
    if (moved) is_near = !is_near;
    answering.kill();
    answering.start(is_near ? near.tcp_url() : far.tcp_url());
  };
  const std::vector<std::function<void()>> events{
      [&] { restart(false); }, [&] { middle.kill_and_restart(); }, [&] { proxy.cut_now(); },
      [&] { restart(true); }, [&] { proxy.cut_now(); }};
  try {
    for (std::uint64_t i = 0; answered < wanted_answers(); ++i) {
      const Deadline deadline;
      const std::uint64_t enough = answered + answers_between_events();
      while (answered < enough) {
        deadline.check("answers");
        wait_readable({}, 1);
      }
      events[i % events.size()]();
    }
  } catch (const std::exception& error) {
    ADD_FAILURE() << error.what();
  }
  over = true;
  for (std::thread& thread : threads) thread.join();
  answering.kill();
  const std::string words = check(askers, file);
  std::filesystem::remove_all(folder);
  RecordProperty("endings", words);
  if (HasFailure()) ADD_FAILURE() << words;
}

}  // namespace
}  // namespace gimnet::stress

int main(int argc, char** argv) {
  if (argc == 4 && std::string_view(argv[1]) == "--answer") {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    return gimnet::stress::answer_requests(argv[2], argv[3]);
  }
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
