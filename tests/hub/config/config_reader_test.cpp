#include "hub/config/config_reader.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <semaphore>

#include "hub/config/reloader.hpp"

namespace gimnet::hub {
namespace {

using namespace std::chrono_literals;

/// A disk that answers when it is told to. It outlives the threads that it holds up.
struct Disk {
  std::counting_semaphore<> answers{0};
  std::atomic<int> readings{0};
  ConfigReader::Read read(const std::shared_ptr<Disk>& self) {
    return [self](const ConfigSources& sources, const ReadOptions&) {
      ++self->readings;
      self->answers.acquire();
      ReadConfiguration result;
      result.place.file = sources.file;
      return result;
    };
  }
};

constexpr std::chrono::milliseconds kShort{1};
constexpr std::chrono::milliseconds kForEver{600'000};

class ConfigReaderTest : public ::testing::Test {
 protected:
  ~ConfigReaderTest() override { disk_->answers.release(10); }

  const std::shared_ptr<Disk> disk_ = std::make_shared<Disk>();
};

TEST_F(ConfigReaderTest, GivesWhatWasReadInTime) {
  disk_->answers.release();
  ConfigReader reader(disk_->read(disk_), kForEver);
  const auto read = reader.read({.file = "hub.toml", .environment = {}, .flags = {}}, {});
  ASSERT_TRUE(read);
  EXPECT_EQ(read->place.file, "hub.toml");
}

TEST_F(ConfigReaderTest, WaitsForADiskThatDoesNotAnswerNoLongerThanItsPatience) {
  ConfigReader reader(disk_->read(disk_), kShort);
  EXPECT_FALSE(reader.read({}, {}));
}

TEST_F(ConfigReaderTest, BeginsNoSecondReadingWhileOneIsHeldUp) {
  ConfigReader reader(disk_->read(disk_), kShort);
  while (disk_->readings == 0) EXPECT_FALSE(reader.read({}, {}));
  EXPECT_FALSE(reader.read({}, {}));
  EXPECT_EQ(disk_->readings, 1);
}

TEST_F(ConfigReaderTest, AHubWhoseDiskDoesNotAnswerSaysSoAndTakesTheNextReading) {
  Reloader reloader({.file = "/far/hub.toml", .environment = {}, .flags = {}}, {},
                    ConfigReader(disk_->read(disk_), kShort));
  const Reloading held_up = reloader.read_again();
  ASSERT_EQ(held_up.faults.size(), 1u);
  EXPECT_NE(held_up.faults[0].find("/far/hub.toml"), std::string::npos) << held_up.faults[0];
  EXPECT_NE(held_up.faults[0].find("does not answer"), std::string::npos) << held_up.faults[0];
  EXPECT_TRUE(held_up.changes.empty());
  disk_->answers.release(1'000'000);
  Reloading again = reloader.read_again();
  while (!again.faults.empty()) again = reloader.read_again();
  EXPECT_GE(disk_->readings, 2);
}

}  // namespace
}  // namespace gimnet::hub
