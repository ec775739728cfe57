#include "hub/config/link_settings.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hub/config/options.hpp"
#include "hub/config/toml_file.hpp"

namespace gimnet::hub {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

struct Read {
  Configuration configuration;
  Faults faults;
};

Read read(const std::string& text, const std::string& proxy = "") {
  Read result;
  result.configuration.proxy = proxy;
  TomlFile file = read_toml(text, "f");
  result.faults = file.faults;
  for (const Given& given : file.keys) apply(result.configuration, given, result.faults);
  complete(result.configuration, result.faults);
  return result;
}

/// Of a configuration that is right.
LinksOptions links(const std::string& text, const std::string& proxy = "") {
  const Read result = read(text, proxy);
  EXPECT_THAT(result.faults, IsEmpty()) << text << result.faults.front().line();
  return result.configuration.options.links;
}

/// The only thing that is wrong with `text`.
std::string fault(const std::string& text, const std::string& proxy = "") {
  const Read result = read(text, proxy);
  EXPECT_THAT(result.faults, SizeIs(1)) << text;
  return result.faults.empty() ? "" : result.faults.front().line();
}

std::string link_fault(const std::string& line) {
  return fault("[[link]]\nurl = 'tcp://127.0.0.1:1'\n" + line);
}

using Arguments = std::vector<const char*>;

std::variant<CommandLine, CommandLineEnding> parse(Arguments arguments,
                                                   Arguments environment = {}) {
  arguments.insert(arguments.begin(), "tcphub");
  environment.push_back(nullptr);
  return parse_command_line(static_cast<int>(arguments.size()), arguments.data(),
                            environment.data());
}

LinksOptions flags(const Arguments& arguments, const Arguments& environment = {}) {
  const auto parsed = parse(arguments, environment);
  const auto* ending = std::get_if<CommandLineEnding>(&parsed);
  EXPECT_EQ(ending, nullptr) << ending->text;
  return ending == nullptr ? std::get<CommandLine>(parsed).configuration.options.links
                           : LinksOptions{};
}

std::string flags_fault(const Arguments& arguments, const Arguments& environment = {}) {
  const auto parsed = parse(arguments, environment);
  const auto* ending = std::get_if<CommandLineEnding>(&parsed);
  return ending == nullptr ? "" : ending->text;
}

TEST(LinkSettings, EveryKeyIsRead) {
  const LinksOptions all = links(
      "insecure = true\n[links]\naccept_links = true\nkeep_alive_ms = 500\nsilent_ms = 2000\n"
      "allow = [3, 2, 3]\n[[link]]\nurl = 'tcp://lab.example:7450'\nname = 'lab'\ncost = 65535\n"
      "keep_alive_ms = 5000\nsilent_ms = 20000\nallow = [4]\nproxy = 'http://p:3128'\n"
      "[[link]]\nurl = 'unix:/run/other'\n");
  EXPECT_TRUE(all.accept);
  EXPECT_EQ(all.accepted, (LinkTerms{500, 2'000, {HubId{2}, HubId{3}}}));
  ASSERT_THAT(all.dial, SizeIs(2));
  EXPECT_EQ(all.dial[0].address.url(), "tcp://lab.example:7450");
  EXPECT_EQ(all.dial[0].name, "lab");
  EXPECT_EQ(all.dial[0].cost, 65'535);
  EXPECT_EQ(all.dial[0].proxy, "http://p:3128");
  EXPECT_EQ(all.dial[0].terms, (LinkTerms{5'000, 20'000, {HubId{4}}}));
  EXPECT_EQ(all.dial[1].name, "unix:/run/other");
  EXPECT_EQ(all.dial[1].cost, 0);
  EXPECT_EQ(all.dial[1].terms, LinkTerms{});
}

TEST(LinkSettings, ALinkOfFlagsIsAUrl) {
  const LinksOptions two = flags({"--link", "tcp://127.0.0.1:1", "--link=unix:/s"});
  ASSERT_THAT(two.dial, SizeIs(2));
  EXPECT_FALSE(two.accept);
  EXPECT_EQ(two.dial[1].name, "unix:/s");
  EXPECT_TRUE(flags({"--accept-links"}).accept);
  EXPECT_FALSE(flags({"--accept-links=false"}, {"TCPHUB_LINKS_ACCEPT_LINKS=true"}).accept);
  EXPECT_THAT(flags_fault({"--link"}), HasSubstr("--link needs a value: hub to link to"));
  EXPECT_THAT(flags_fault({"--link", "lab:7450"}), HasSubstr("did you mean tcp://lab:7450?"));
  EXPECT_THAT(flags_fault({"--link", "tcp://lab:7450"}), HasSubstr("give --insecure"));
  EXPECT_EQ(flags_fault({"--link", "tcp://lab:7450", "--insecure", "--check-config"}),
            "the configuration is right; read: no file\n");
}

TEST(LinkSettings, TheEnvironmentNamesLinks) {
  const LinksOptions all =
      flags({}, {"TCPHUB_LINK=tcp://127.0.0.1:1, unix:/s", "TCPHUB_LINKS_ACCEPT_LINKS=true",
                 "TCPHUB_LINKS_ALLOW=7 8", "TCPHUB_LINKS_SILENT_MS=3000"});
  EXPECT_THAT(all.dial, SizeIs(2));
  EXPECT_TRUE(all.accept);
  EXPECT_EQ(all.accepted.silent_ms, 3'000u);
  EXPECT_THAT(all.accepted.allow, ElementsAre(HubId{7}, HubId{8}));
  EXPECT_THAT(flags_fault({}, {"TCPHUB_LINK="}), HasSubstr("TCPHUB_LINK is empty"));
  EXPECT_THAT(flags_fault({}, {"TCPHUB_LINKS_ALLOW=x"}),
              HasSubstr("a hub of TCPHUB_LINKS_ALLOW cannot be 'x'"));
}

TEST(LinkSettings, ALinkToAnotherMachineNeedsTheWord) {
  EXPECT_EQ(fault("[[link]]\nurl = 'tcp://10.0.0.1:7450'"),
            "f:2:7: cannot link to tcp://10.0.0.1:7450: it is another machine, and nothing that is "
            "sent is encrypted; where all machines on the way are trusted give insecure = true, "
            "otherwise link through a tunnel to 127.0.0.1");
  EXPECT_THAT(links("[[link]]\nurl = 'tcp://localhost:7450'").dial, SizeIs(1));
}

TEST(LinkSettings, SaysWhatIsWrongWithALink) {
  EXPECT_EQ(fault("[[link]]\nurl = 'tcp://lab'"),
            "f:2:7: cannot use the hub URL 'tcp://lab': the port is missing; give tcp://host:port "
            "or unix:/path, such as tcp://lab:7450");
  EXPECT_EQ(fault("[[link]]\nname = 'a'"),
            "f:1:1: this link has no url: write [[link]], and below it url = "
            "\"tcp://127.0.0.1:7451\"");
  EXPECT_THAT(fault("[link]\nurl = 'tcp://127.0.0.1:1'"),
              HasSubstr("link is a list of tables, not a table: write [[link]]"));
  EXPECT_THAT(fault("link = 'tcp://127.0.0.1:1'"), HasSubstr("not a text: write [[link]]"));
  EXPECT_THAT(fault("link = ['tcp://127.0.0.1:1']"),
              HasSubstr("f:1:9: a link is a table, not a text"));
  EXPECT_EQ(link_fault("csot = 5"), "f:3:8: a link has no key 'csot'; did you mean cost?");
  EXPECT_EQ(link_fault("cost = 0"),
            "f:3:8: link.cost cannot be '0': give a whole number from 1 to 65535");
  EXPECT_THAT(link_fault("cost = 65536"), HasSubstr("1 to 65535"));
  EXPECT_EQ(link_fault("cost = '7'"),
            "f:3:8: link.cost is a whole number, not a text: write cost = 7");
  EXPECT_THAT(link_fault("name = 7"), HasSubstr("write name = \"lab\""));
  EXPECT_THAT(link_fault("name = 'a b'"), HasSubstr("a link cannot have the name 'a b'"));
  EXPECT_THAT(link_fault("keep_alive_ms = 9"), HasSubstr("10 to 3600000"));
  EXPECT_THAT(link_fault("silent_ms = 3600001"), HasSubstr("30 to 3600000"));
  EXPECT_EQ(link_fault("silent_ms = 250"),
            "f:1:1: of this link silent_ms (250) must be larger than keep_alive_ms (250), or a "
            "healthy link is ended as silent");
  EXPECT_THAT(link_fault("allow = 7"), HasSubstr("link.allow is a list, not a whole number"));
  EXPECT_THAT(link_fault("allow = [0]"), HasSubstr("f:3:10: a hub of link.allow cannot be '0'"));
  EXPECT_THAT(link_fault("allow = ['x']"), HasSubstr("write allow = 1"));
}

TEST(LinkSettings, TwoLinksWithOneNameAreTold) {
  EXPECT_EQ(fault("[[link]]\nurl = 'unix:/a'\n[[link]]\nurl = 'unix:/a'"),
            "f:4:7: link 'unix:/a' is given twice: leave one out, or give each a name of its own");
  EXPECT_THAT(links("[[link]]\nurl = 'unix:/a'\n[[link]]\nurl = 'unix:/a'\nname = 'b'").dial,
              SizeIs(2));
  EXPECT_THAT(flags_fault({"--link", "unix:/a", "--link", "unix:/a"}), HasSubstr("given twice"));
  std::string many;
  for (std::size_t i = 0; i <= kDialledLinksMax; ++i)
    many += "[[link]]\nurl = 'unix:/" + std::to_string(i) + "'\n";
  EXPECT_THAT(fault(many), HasSubstr("there are 4094 links; a hub dials at most 4093"));
}

TEST(LinkSettings, SaysWhatIsWrongWithAcceptedLinks) {
  EXPECT_THAT(fault("links = 5"), HasSubstr("links is a table: write [links]"));
  EXPECT_THAT(fault("[links]\naccept_link = true"), HasSubstr("did you mean links.accept_links?"));
  EXPECT_EQ(fault("[links]\naccept_links = 'yes'"),
            "f:2:16: links.accept_links is true or false, not a text: write accept_links = true");
  EXPECT_EQ(fault("[links]\nsilent_ms = 100"),
            "f:2:13: of accepted links silent_ms (100) must be larger than keep_alive_ms (250), or "
            "a healthy link is ended as silent");
  EXPECT_THAT(fault("[links]\nkeep_alive_ms = 1000"), HasSubstr("f:2:17"));
}

TEST(LinkSettings, TheProxyOfTheEnvironmentIsForLinksThatNameNone) {
  const LinksOptions all = links(
      "[[link]]\nurl = 'tcp://127.0.0.1:1'\n[[link]]\nurl = 'tcp://127.0.0.1:2'\nproxy = ''\n"
      "[[link]]\nurl = 'unix:/s'\n[[link]]\nurl = 'tcp://127.0.0.1:3'\nproxy = 'http://q:1'",
      "http://ann:secret@p:3128");
  ASSERT_THAT(all.dial, SizeIs(4));
  EXPECT_EQ(all.dial[0].proxy, "http://ann:secret@p:3128");
  EXPECT_EQ(all.dial[1].proxy, "");
  EXPECT_EQ(all.dial[2].proxy, "") << "a Unix socket";
  EXPECT_EQ(all.dial[3].proxy, "http://q:1");
  EXPECT_EQ(flags({"--link", "tcp://127.0.0.1:1"}, {"GIMNET_PROXY=http://p:1"}).dial[0].proxy,
            "http://p:1");
  EXPECT_EQ(
      flags({"--link", "tcp://127.0.0.1:1", "--proxy", "http://q:1"}, {"GIMNET_PROXY=http://p:1"})
          .dial[0]
          .proxy,
      "http://q:1");
  EXPECT_THAT(fault("[[link]]\nurl = 'tcp://127.0.0.1:1'", "socks5://ann:secret@p"),
              AllOf(HasSubstr("GIMNET_PROXY: cannot use the proxy"), Not(HasSubstr("secret"))));
  EXPECT_THAT(links("", "socks5://p").dial, IsEmpty()) << "nothing uses it";
  EXPECT_THAT(link_fault("proxy = 'p:3128'"), HasSubstr("its URL does not begin with http://"));
  EXPECT_THAT(fault("[[link]]\nurl = 'unix:/s'\nproxy = 'http://p:1'"),
              HasSubstr("no proxy reaches unix:/s"));
}

TEST(LinkSettings, WhatIsPrintedIsReadAgainAndHasNoPassword) {
  const std::string text =
      "[links]\naccept_links = true\nallow = [2]\n[[link]]\nurl = 'tcp://[::1]:1'\nname = 'a\"b'\n"
      "cost = 5\nallow = [7, 9]\nproxy = 'http://ann:secret@p:1'\n[[link]]\nurl = 'unix:/s'\n";
  const std::string printed = print(read(text).configuration);
  EXPECT_THAT(
      printed,
      AllOf(HasSubstr("\nlink = [{ url = \"tcp://[::1]:1\", name = \"a\\\"b\", cost = 5, "
                      "keep_alive_ms = 250, silent_ms = 1000, allow = [7, 9], proxy = "
                      "\"http://ann:***@p:1\" }, { url = \"unix:/s\", name = \"unix:/s\", "
                      "keep_alive_ms = 250, silent_ms = 1000 }]  # f:4\n"),
            HasSubstr("\n[links]\naccept_links = true  # f:2\nkeep_alive_ms = 250  # default\n"
                      "silent_ms = 1000  # default\nallow = [2]  # f:3\n\n[limits]\n"),
            Not(HasSubstr("secret"))));
  const HubOptions again = read(printed).configuration.options;
  EXPECT_EQ(show_link(again), show_link(read(text).configuration.options));
  EXPECT_EQ(again.links.accepted, (LinkTerms{250, 1'000, {HubId{2}}}));
  EXPECT_THAT(links("link = []\n[links]\nallow = []").dial, IsEmpty());
}

}  // namespace
}  // namespace gimnet::hub
