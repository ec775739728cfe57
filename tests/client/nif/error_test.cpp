#include "client/nif/error.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <set>
#include <string>
#include <thread>
#include <utility>

#include "proto/frame/frame_header.hpp"

namespace gimnet::nif::test {
namespace {

TEST(Error, EveryStatusHasItsText) {
  std::set<std::string> texts;
  for (int status = NIF_OK; status <= NIF_NOT_RETAINED; ++status) {
    EXPECT_TRUE(texts.insert(nif_status_text(static_cast<nif_status>(status))).second) << status;
  }
  EXPECT_STREQ(nif_status_text(static_cast<nif_status>(NIF_NOT_RETAINED + 1)), "unknown status");
}

TEST(Error, TheSentenceBelongsToItsThread) {
  EXPECT_EQ(fail(NIF_DENIED, "mine"), NIF_DENIED);
  std::thread([] {
    EXPECT_STREQ(nif_error_text(), "");
    EXPECT_EQ(fail({NIF_LIMIT, "theirs"}), NIF_LIMIT);
  }).join();
  EXPECT_STREQ(nif_error_text(), "mine");
}

TEST(Error, CutsLongSentencesBetweenCharacters) {
  static_cast<void>(fail(NIF_SYSTEM, std::string(NIF_SENTENCE_BYTES_MAX, 'x')));
  EXPECT_EQ(std::strlen(nif_error_text()), 1024u);
  static_cast<void>(fail(NIF_SYSTEM, std::string(NIF_SENTENCE_BYTES_MAX + 1, 'x')));
  EXPECT_EQ(std::strlen(nif_error_text()), 1024u);
  const std::string fits(NIF_SENTENCE_BYTES_MAX - 1, 'x');
  static_cast<void>(fail(NIF_SYSTEM, fits + "\xC3\xBC and so on"));
  EXPECT_EQ(nif_error_text(), fits) << "half a character";
}

TEST(Error, DropReasonsAreThoseOfTheWire) {
  const std::pair<nif_drop_reason, proto::DropReason> pairs[] = {
      {NIF_DROP_NO_SUCH_NODE, proto::DropReason::no_such_node},
      {NIF_DROP_NO_ROUTE, proto::DropReason::no_route},
      {NIF_DROP_AWAY, proto::DropReason::away},
      {NIF_DROP_QUEUE_FULL, proto::DropReason::queue_full},
      {NIF_DROP_REPLACED, proto::DropReason::replaced},
      {NIF_DROP_TOO_OLD, proto::DropReason::too_old},
      {NIF_DROP_HOP_LIMIT, proto::DropReason::hop_limit},
      {NIF_DROP_TOO_LARGE, proto::DropReason::too_large},
      {NIF_DROP_NOT_ALLOWED, proto::DropReason::not_allowed},
      {NIF_DROP_WRONG_WAY, proto::DropReason::wrong_way},
      {NIF_DROP_LINK_LOST, proto::DropReason::link_lost},
      {NIF_DROP_SHARD_FULL, proto::DropReason::shard_full},
      {NIF_DROP_NO_SUCH_GROUP, proto::DropReason::no_such_group},
      {NIF_DROP_RENUMBERED, proto::DropReason::renumbered},
      {NIF_DROP_OVER_BUDGET, proto::DropReason::over_budget},
      {NIF_DROP_TIMED_OUT, proto::DropReason::timed_out},
      {NIF_DROP_CUT_MESSAGE, proto::DropReason::cut_message},
      {NIF_DROP_NO_SUBSCRIBER, proto::DropReason::no_subscriber},
      {NIF_DROP_MALFORMED, proto::DropReason::malformed},
      {NIF_DROP_WRONG_SOURCE, proto::DropReason::wrong_source},
      {NIF_DROP_NOT_RETAINED, proto::DropReason::not_retained},
      {NIF_DROP_LINK_UNSURE, proto::DropReason::link_unsure},
  };
  EXPECT_EQ(std::size(pairs) + 1, proto::kDropReasonCount) << "and none";
  for (const auto& [known, wire] : pairs)
    EXPECT_EQ(static_cast<int>(known), static_cast<int>(wire));
}

}  // namespace
}  // namespace gimnet::nif::test
