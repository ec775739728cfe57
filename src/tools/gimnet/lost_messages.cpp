#include "tools/gimnet/lost_messages.hpp"

#include <string_view>

namespace gimnet::tool {
namespace {

struct Words {
  std::string what;
  std::string why;
};

void add_sentence(std::vector<std::string>& sentences, std::uint64_t count, std::uint64_t told,
                  const Words& words) {
  if (count == told) return;
  sentences.push_back(std::to_string(count) + " " + words.what +
                      (count == 1 ? " was lost: " : "s were lost: ") + std::string(words.why));
}

}  // namespace

std::string queue_full_words(std::string_view whose, const Peer& filled_by) {
  std::string words = "the queue of " + std::string(whose) + " at the hub was full";
  if (filled_by) words += ", mostly of what " + filled_by.text() + " sent";
  return words;
}

std::vector<std::string> LostMessages::news(std::int64_t now_ns) {
  const bool known = all() == told_.all() && counts_.queue_full == told_.queue_full;
  if (known || !pace_.due(now_ns)) return {};
  return rest();
}

std::vector<std::string> LostMessages::rest() {
  std::vector<std::string> sentences;
  add_sentence(sentences, counts_.incomplete, told_.incomplete,
               {"message", "a part did not come, or did not fit the others"});
  add_sentence(sentences, counts_.too_large, told_.too_large,
               {"message", "larger than this end takes"});
  add_sentence(
      sentences, counts_.frames_broken_off, told_.frames_broken_off,
      {"frame", "on the way when the connection broke, and a large message has many frames"});
  add_sentence(sentences, counts_.unknown_service, told_.unknown_service,
               {"message", "of a service that this end does not know to have subscribed"});
  add_sentence(sentences, counts_.unreadable, told_.unreadable,
               {"frame", "another node broke the protocol, or sent a key without a GIMI header"});
  add_sentence(sentences, counts_.outdated, told_.outdated,
               {"message", "its sender had been started again, and had sent newer ones"});
  add_sentence(sentences, counts_.queue_full, told_.queue_full,
               {"frame", queue_full_words("this node", counts_.queue_filled_by)});
  told_ = counts_;
  return sentences;
}

}  // namespace gimnet::tool
