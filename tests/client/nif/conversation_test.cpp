#include <gtest/gtest.h>

#include <filesystem>
#include <ostream>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "gimnet/nif.h"
#include "tests/client/nif/support/fake_hub.hpp"
#include "tests/client/nif/support/recorded_hub.hpp"
#include "tests/client/nif/support/recorded_node.hpp"
#include "tests/client/nif/support/recording.hpp"

// Conversations with a hub of version 1, as they were recorded (tests/vectors/conversation): what
// that hub said to each node is understood by the library of today, frame by frame, and what the
// library says is what was said then.

namespace gimnet::nif::test {
namespace {

/// One node of a recording, and what the recording has for it.
struct Part {
  const char* recording;
  std::vector<std::string> who;  ///< its names, connection by connection
  std::size_t messages;
  std::size_t events;
  std::size_t answers;
};
void PrintTo(const Part& part, std::ostream* out) { *out << part.recording << ", " << part.who[0]; }

const std::vector<Part>& parts() {
  static const std::vector<Part> all = {
      {"version_1", {"robot"}, 3, 4, 5},
      {"version_1", {"viewer", "again"}, 4, 13, 21},
      {"version_1", {"admin"}, 0, 0, 4},
      {"version_1_data", {"robot"}, 0, 1, 0},
      {"version_1_data", {"viewer"}, 5, 0, 0},
      {"version_1_resume", {"robot"}, 0, 3, 0},
      {"version_1_resume", {"viewer", "again"}, 13, 1, 0},
      {"version_1_end", {"robot"}, 0, 0, 0},
      {"version_1_end", {"rival"}, 0, 0, 0},
      {"version_1_end", {"admin"}, 0, 0, 1},
  };
  return all;
}

class Conversation : public ::testing::TestWithParam<Part> {
 protected:
  static void play(const std::vector<Connection>& connections, const nif_options& options,
                   RecordedHub& hub) {
    nif_node* handle = nullptr;
    const nif_status connected = nif_connect(&options, &handle);
    const OpenNode node(handle);
    const Step& answer = connections[0][1];
    if (is_goodbye(answer)) {
      EXPECT_EQ(proto::decode<proto::Goodbye>(answer.view().payload)->code,
                proto::GoodbyeCode::name_taken);
      EXPECT_EQ(connected, NIF_NAME_TAKEN);
      return;
    }
    ASSERT_EQ(connected, NIF_OK) << nif_error_text();
    RecordedNode player(connections, handle, hub);
    player.play();
    EXPECT_EQ(player.messages(), GetParam().messages);
    EXPECT_EQ(player.events(), GetParam().events);
    EXPECT_EQ(player.answers(), GetParam().answers);
  }
};

TEST_P(Conversation, WhatAHubOfVersion1SaidIsUnderstood) {
  const std::vector<Connection> connections = connections_of(GetParam().recording, GetParam().who);
  const proto::Hello hello = proto::decode<proto::Hello>(connections[0][0].view().payload).value();
  FakeHub hub;
  RecordedHub recorded(connections, hub);
  std::thread playing([&recorded] { recorded.play(); });
  nif_options options = default_options(hello.name.c_str());
  const std::string url = hub.url();
  options.url = url.c_str();
  options.description = hello.description.c_str();
  options.administrator = hello.role == proto::Role::admin ? 1 : 0;
  options.resume = hello.resume ? NIF_RESUME_ON : NIF_RESUME_OFF;
  play(connections, options, recorded);
  playing.join();
}

std::string title(const ::testing::TestParamInfo<Part>& tested) {
  return std::string(tested.param.recording) + "_" + tested.param.who[0];
}
INSTANTIATE_TEST_SUITE_P(Recorded, Conversation, ::testing::ValuesIn(parts()), title);

TEST(Recordings, EveryNodeOfEachIsPlayed) {
  std::size_t recordings = 0;
  for (const auto& entry : std::filesystem::directory_iterator(recordings_folder())) {
    const std::string name = entry.path().stem().string();
    std::set<std::string> played;
    for (const Part& part : parts()) {
      if (part.recording == name) played.insert(part.who.begin(), part.who.end());
    }
    EXPECT_EQ(played, who_speaks_in(name)) << name;
    ++recordings;
  }
  EXPECT_GE(recordings, 4u);
}

}  // namespace
}  // namespace gimnet::nif::test
