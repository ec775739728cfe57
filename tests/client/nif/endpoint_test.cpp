#include "client/nif/endpoint.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

#include "client/nif/platform.hpp"
#include "tests/client/nif/support/environment.hpp"

namespace gimnet::nif::test {
namespace {

TEST(Endpoint, ReadsUrlsAndWritesThemBack) {
  for (const char* const url :
       {"tcp://127.0.0.1:7450", "tcp://robot.local:1", "tcp://[::1]:65535", "unix:/run/hub"}) {
    const auto endpoint = parse_endpoint(url);
    ASSERT_TRUE(endpoint) << url;
    EXPECT_EQ(endpoint->url(), url);
  }
  EXPECT_EQ(parse_endpoint("tcp://[::1]:5")->host, "::1");
}

TEST(Endpoint, RefusesWhatItDoesNotUnderstand) {
  for (const char* const url :
       {"", "tcp:", "tcp://", "tcp://host", "tcp://host:", "tcp://host:0", "tcp://host:65536",
        "tcp://host:7x", "tcp://:7450", "unix:", "http://host:80", "host:7450", "tcp://[::1:7450",
        "tcp://::1]:7450"}) {
    const auto endpoint = parse_endpoint(url);
    ASSERT_FALSE(endpoint) << url;
    EXPECT_EQ(endpoint.error().status, NIF_BAD_ARGUMENT);
    EXPECT_NE(endpoint.error().sentence.find(std::string("'") + url + "'"), std::string::npos);
  }
}

TEST(Endpoint, SaysWhatWasMeant) {
  const auto said = [](const char* url) { return parse_endpoint(url).error().sentence; };
  EXPECT_TRUE(said("127.0.0.1:7450").ends_with("; did you mean tcp://127.0.0.1:7450?"));
  EXPECT_TRUE(said("tcp:/127.0.0.1:7450").ends_with("; did you mean tcp://127.0.0.1:7450?"));
  EXPECT_TRUE(said("/run/hub").ends_with("; did you mean unix:/run/hub?"));
  EXPECT_TRUE(said("http:/h:1").ends_with("; give tcp://host:port or unix:/path"))
      << said("http:/h:1");
  EXPECT_TRUE(said("tcp:/").ends_with("; give tcp://host:port or unix:/path")) << said("tcp:/");
}

TEST(Endpoint, TakesUnixPathsUpToWhatTheSystemTakes) {
  const std::string longest = "/" + std::string(unix_path_max() - 1, 'p');
  EXPECT_TRUE(parse_endpoint("unix:" + longest));
  EXPECT_FALSE(parse_endpoint("unix:" + longest + "p"));
}

TEST(Endpoint, PrefersTheUrlThenTheEnvironmentThenTheDefaults) {
  const Environment hub("GIMNET_HUB", "tcp://h:1");
  EXPECT_EQ((*endpoints_for("tcp://given:2"))[0].url(), "tcp://given:2");
  EXPECT_EQ((*endpoints_for(""))[0].url(), "tcp://h:1");
  const Environment none("GIMNET_HUB", "");
  const Environment runtime("XDG_RUNTIME_DIR", "/run/user/7");
  const auto defaults = endpoints_for("");
  ASSERT_TRUE(defaults);
  ASSERT_EQ(defaults->size(), 2u);
  EXPECT_EQ((*defaults)[0].url(), "unix:/run/user/7/gimnet/tcphub.sock");
  EXPECT_EQ((*defaults)[1].url(), "tcp://127.0.0.1:7450");
  const Environment wrong("GIMNET_HUB", "nonsense");
  const auto refused = endpoints_for("");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().sentence.find("GIMNET_HUB"), std::string::npos);
}

// As a hub does: else it would look where none is.
TEST(Endpoint, LooksNowhereElseForAVariableThatIsNoAbsolutePath) {
  std::string folder = ::testing::TempDir() + "nif_endpoint_XXXXXX";
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  const Environment hub("GIMNET_HUB", "");
  const Environment runtime("XDG_RUNTIME_DIR", "run/user");
  const Environment temporary("TMPDIR", folder.c_str());
  const std::string own = folder + "/gimnet-" + std::to_string(::geteuid());
  ASSERT_EQ(::mkdir(own.c_str(), 0700), 0);
  EXPECT_EQ((*endpoints_for(""))[0].url(), "unix:" + own + "/tcphub.sock");
  ::rmdir(own.c_str());
  ::rmdir(folder.c_str());
}

TEST(Endpoint, SuggestsTheSchemeThatIsMissing) {
  EXPECT_NE(
      parse_endpoint("localhost:7450").error().sentence.find("did you mean tcp://localhost:7450?"),
      std::string::npos);
  EXPECT_NE(parse_endpoint("localhost").error().sentence.find("give tcp://host:port"),
            std::string::npos);
}

TEST(Endpoint, TrustsOnlyAFolderOfItsOwnUser) {
  std::string folder = ::testing::TempDir() + "nif_endpoint_XXXXXX";
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  const Environment runtime("XDG_RUNTIME_DIR", "");
  const Environment hub("GIMNET_HUB", "");
  const Environment temporary("TMPDIR", folder.c_str());
  EXPECT_EQ(endpoints_for("")->size(), 1u) << "no folder: only TCP";
  const std::string own = folder + "/gimnet-" + std::to_string(::getuid());
  ASSERT_EQ(::mkdir(own.c_str(), 0700), 0);
  EXPECT_EQ((*endpoints_for(""))[0].url(), "unix:" + own + "/tcphub.sock");
  ASSERT_EQ(::chmod(own.c_str(), 0770), 0);
  EXPECT_EQ(endpoints_for("")->size(), 1u) << "others may write there";
  ASSERT_EQ(::rmdir(own.c_str()), 0);
  ASSERT_EQ(::symlink("/tmp", own.c_str()), 0);
  EXPECT_EQ(endpoints_for("")->size(), 1u) << "a link may lead anywhere";
  ::unlink(own.c_str());
  ::rmdir(folder.c_str());
}

}  // namespace
}  // namespace gimnet::nif::test
