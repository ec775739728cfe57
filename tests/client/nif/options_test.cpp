#include "client/nif/options.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <string>

namespace gimnet::nif::test {
namespace {

nif_options given() {
  nif_options options{};
  options.struct_size = sizeof options;
  options.url = "tcp://127.0.0.1:1";
  return options;
}

TEST(Options, ZeroIsTheDefault) {
  const auto options = read_options(nullptr);
  ASSERT_TRUE(options);
  EXPECT_EQ(options->receive_queue_bytes, 16u << 20);
  EXPECT_EQ(options->reassembly.message_bytes_max, 64u << 20);
  EXPECT_EQ(options->send.queue_bytes, 256u << 10);
  EXPECT_EQ(options->send.retained_bytes, 512u << 10);
  EXPECT_EQ(options->last_message_bytes, 16u << 20);
  EXPECT_EQ(options->connect_timeout_ms, 5'000);
  EXPECT_TRUE(options->reconnect);
  EXPECT_FALSE(options->resume) << "a node without a name";
}

TEST(Options, ResumeIsOnForNamedNodesUnlessSaidOtherwise) {
  nif_options options = given();
  options.name = "robot";
  EXPECT_TRUE(read_options(&options)->resume);
  options.resume = NIF_RESUME_OFF;
  EXPECT_FALSE(read_options(&options)->resume);
  options.name = nullptr;
  options.resume = NIF_RESUME_ON;
  EXPECT_TRUE(read_options(&options)->resume);
  options.resume = 3;
  EXPECT_EQ(read_options(&options).error().status, NIF_BAD_ARGUMENT);
}

TEST(Options, TakesAProxy) {
  nif_options options = given();
  options.proxy = "http://p:3128";
  ASSERT_TRUE(read_options(&options));
  EXPECT_EQ(read_options(&options)->dialling.proxy->port, 3128);
  options.proxy = "p:3128";
  EXPECT_EQ(read_options(&options).error().status, NIF_BAD_ARGUMENT);
}

TEST(Options, AnOlderProgramGivesAShorterStruct) {
  nif_options options = given();
  options.description = "not there yet";
  options.struct_size = offsetof(nif_options, description);
  const auto read = read_options(&options);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->description, "");
  options.struct_size = 0;
  EXPECT_EQ(read_options(&options).error().status, NIF_BAD_ARGUMENT);
}

TEST(Options, ANewerProgramMayNotAskForWhatIsNotThere) {
  struct Newer {
    nif_options known;
    std::array<unsigned char, 8> more;
  } options{given(), {}};
  options.known.struct_size = sizeof options;
  EXPECT_TRUE(read_options(&options.known));
  options.more[7] = 1;
  EXPECT_EQ(read_options(&options.known).error().status, NIF_BAD_ARGUMENT);
}

TEST(Options, ChecksNamesAndLimits) {
  nif_options options = given();
  options.name = "two//parts";
  EXPECT_EQ(read_options(&options).error().status, NIF_BAD_NAME);
  const std::string longest(255, 'n');
  options.name = longest.c_str();
  EXPECT_TRUE(read_options(&options));
  const std::string longer(256, 'n');
  options.name = longer.c_str();
  EXPECT_EQ(read_options(&options).error().status, NIF_BAD_NAME);

  options = given();
  const std::string description(257, 'd');
  options.description = description.c_str();
  EXPECT_FALSE(read_options(&options));
  options.description = description.c_str() + 1;
  EXPECT_TRUE(read_options(&options));

  options = given();
  options.message_bytes_max = NIF_MESSAGE_BYTES_MAX;
  ASSERT_TRUE(read_options(&options));
  EXPECT_EQ(read_options(&options)->reassembly.waiting_bytes_max, NIF_MESSAGE_BYTES_MAX);
  options.message_bytes_max = NIF_MESSAGE_BYTES_MAX + 1;
  EXPECT_FALSE(read_options(&options));
  options.message_bytes_max = 1000;
  options.reassembly_bytes = 999;
  EXPECT_FALSE(read_options(&options));
  options = given();
  options.last_message_bytes = 64u << 20;
  ASSERT_TRUE(read_options(&options));
  EXPECT_EQ(read_options(&options)->last_message_bytes, 64u << 20);
  ++options.last_message_bytes;
  EXPECT_FALSE(read_options(&options));
  options = given();
  options.url = "nonsense";
  EXPECT_FALSE(read_options(&options));
}

}  // namespace
}  // namespace gimnet::nif::test
