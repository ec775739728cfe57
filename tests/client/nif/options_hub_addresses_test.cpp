#include "client/nif/options.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

#include "tests/client/nif/support/environment.hpp"

namespace gimnet::nif::test {
namespace {

constexpr auto npos = std::string::npos;

TEST(HubAddresses, PrefersTheUrlThenTheEnvironmentThenTheDefaults) {
  const Environment hub("GIMNET_HUB", "tcp://h:1");
  EXPECT_EQ((*hub_addresses("tcp://given:2"))[0].url(), "tcp://given:2");
  EXPECT_EQ((*hub_addresses(""))[0].url(), "tcp://h:1");
  const Environment none("GIMNET_HUB", "");
  const Environment runtime("XDG_RUNTIME_DIR", "/run/user/7");
  const auto defaults = hub_addresses("");
  ASSERT_TRUE(defaults);
  ASSERT_EQ(defaults->size(), 2u);
  EXPECT_EQ((*defaults)[0].url(), "unix:/run/user/7/gimnet/tcphub.sock");
  EXPECT_EQ((*defaults)[1].url(), "tcp://127.0.0.1:7450");
  const Environment wrong("GIMNET_HUB", "nonsense");
  const auto refused = hub_addresses("");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().sentence.find("GIMNET_HUB"), std::string::npos);
}

TEST(HubAddresses, TakesAListOfHubs) {
  const auto urls = [](const char* list) {
    std::vector<std::string> all;
    const auto addresses = hub_addresses(list);
    EXPECT_TRUE(addresses) << list;
    if (!addresses) return all;
    for (const net::Address& each : *addresses) all.push_back(each.url());
    return all;
  };
  const std::vector<std::string> both{"tcp://a:1", "unix:/b,c"};
  EXPECT_EQ(urls("tcp://a:1, unix:/b,c"), both) << "a path may have a comma";
  EXPECT_EQ(urls("tcp://a:1,tcp://b:7450,tcp://c:3").size(), 3u);
  std::string many = "tcp://a:1";
  for (std::size_t i = 1; i < kHubsMax; ++i) many += ",tcp://a:1";
  EXPECT_EQ(urls(many.c_str()).size(), kHubsMax);
  many += ",tcp://a:1";
  for (const char* wrong : {"tcp://a:1,tcp://", "tcp://a:1,nonsense", many.c_str()}) {
    const auto refused = hub_addresses(wrong);
    ASSERT_FALSE(refused) << wrong;
    EXPECT_EQ(refused.error().status, NIF_BAD_ARGUMENT);
  }
  const Environment proxy("GIMNET_PROXY", "http://env:1");
  EXPECT_TRUE(*proxy_to_hub(nullptr, "unix:/b,tcp://a:1"));
}

TEST(ProxyToHub, IsTheOneAskedForOrThatOfTheEnvironmentForANamedHub) {
  const Environment hub("GIMNET_HUB", "");
  const Environment proxy("GIMNET_PROXY", "http://env:1");
  EXPECT_EQ((*proxy_to_hub(nullptr, "tcp://h:1"))->host, "env");
  EXPECT_EQ((*proxy_to_hub("http://ann:secret@given:2", "tcp://h:1"))->host, "given");
  EXPECT_FALSE(*proxy_to_hub("", "tcp://h:1")) << "none is asked for";
  EXPECT_FALSE(*proxy_to_hub(nullptr, "unix:/a"));
  EXPECT_FALSE(*proxy_to_hub(nullptr, "")) << "the hub of this machine";
  const Environment named("GIMNET_HUB", "tcp://h:1");
  EXPECT_EQ((*proxy_to_hub(nullptr, ""))->host, "env");
  const Environment none("GIMNET_PROXY", "");
  EXPECT_FALSE(*proxy_to_hub(nullptr, "tcp://h:1"));
}

TEST(ProxyToHub, SaysWhatIsWrong) {
  const Environment hub("GIMNET_HUB", "");
  const auto fault = [](const char* proxy, const char* url) {
    const auto refused = proxy_to_hub(proxy, url);
    EXPECT_FALSE(refused);
    if (refused) return std::string();
    EXPECT_EQ(refused.error().status, NIF_BAD_ARGUMENT);
    return refused.error().sentence;
  };
  EXPECT_NE(fault("http://p:1", "unix:/a").find("no proxy reaches unix:/a"), npos);
  EXPECT_NE(fault("http://p:1", "").find("give tcp://host:port, too"), npos);
  EXPECT_NE(fault("p:1", "tcp://h:1").find("write http://HOST:PORT"), npos);
  const Environment proxy("GIMNET_PROXY", "http://ann:secret@p");
  const std::string words = fault(nullptr, "tcp://h:1");
  EXPECT_NE(words.find("(that is GIMNET_PROXY)"), npos);
  EXPECT_EQ(words.find("secret"), npos);
}

// As a hub does: else it would look where none is.
TEST(HubAddresses, LooksNowhereElseForAVariableThatIsNoAbsolutePath) {
  std::string folder = ::testing::TempDir() + "nif_hub_addresses_XXXXXX";
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  const Environment hub("GIMNET_HUB", "");
  const Environment runtime("XDG_RUNTIME_DIR", "run/user");
  const Environment temporary("TMPDIR", folder.c_str());
  const std::string own = folder + "/gimnet-" + std::to_string(::geteuid());
  ASSERT_EQ(::mkdir(own.c_str(), 0700), 0);
  EXPECT_EQ((*hub_addresses(""))[0].url(), "unix:" + own + "/tcphub.sock");
  ::rmdir(own.c_str());
  ::rmdir(folder.c_str());
}

TEST(HubAddresses, TrustsOnlyAFolderOfItsOwnUser) {
  std::string folder = ::testing::TempDir() + "nif_hub_addresses_XXXXXX";
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  const Environment runtime("XDG_RUNTIME_DIR", "");
  const Environment hub("GIMNET_HUB", "");
  const Environment temporary("TMPDIR", folder.c_str());
  EXPECT_EQ(hub_addresses("")->size(), 1u) << "no folder: only TCP";
  const std::string own = folder + "/gimnet-" + std::to_string(::getuid());
  ASSERT_EQ(::mkdir(own.c_str(), 0700), 0);
  EXPECT_EQ((*hub_addresses(""))[0].url(), "unix:" + own + "/tcphub.sock");
  ASSERT_EQ(::chmod(own.c_str(), 0770), 0);
  EXPECT_EQ(hub_addresses("")->size(), 1u) << "others may write there";
  ASSERT_EQ(::rmdir(own.c_str()), 0);
  ASSERT_EQ(::symlink("/tmp", own.c_str()), 0);
  EXPECT_EQ(hub_addresses("")->size(), 1u) << "a link may lead anywhere";
  ::unlink(own.c_str());
  ::rmdir(folder.c_str());
}

}  // namespace
}  // namespace gimnet::nif::test
