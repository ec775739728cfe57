#include "client/nif/error.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <string>
#include <thread>

namespace gimnet::nif::test {
namespace {

TEST(Error, EveryStatusHasItsText) {
  std::set<std::string> texts;
  for (int status = NIF_OK; status <= NIF_SYSTEM; ++status) {
    EXPECT_TRUE(texts.insert(nif_status_text(static_cast<nif_status>(status))).second) << status;
  }
  EXPECT_STREQ(nif_status_text(static_cast<nif_status>(NIF_SYSTEM + 1)), "unknown status");
}

TEST(Error, TheSentenceBelongsToItsThread) {
  EXPECT_EQ(fail(NIF_DENIED, "mine"), NIF_DENIED);
  std::thread([] {
    EXPECT_STREQ(nif_error_text(), "");
    EXPECT_EQ(fail({NIF_LIMIT, "theirs"}), NIF_LIMIT);
  }).join();
  EXPECT_STREQ(nif_error_text(), "mine");
}

TEST(Error, CutsLongSentences) {
  static_cast<void>(fail(NIF_SYSTEM, std::string(10'000, 'x')));
  EXPECT_EQ(std::strlen(nif_error_text()), 511u);
}

}  // namespace
}  // namespace gimnet::nif::test
