#include "tests/stress/support/playground.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

namespace gimnet::stress {
namespace {

/// Open handles of each kind, in the order of Kind: few enough for threads to meet.
constexpr std::array<std::size_t, kKinds> kMost{6, 12, 16, 8, 8, 4, 32, 6, 4, 4, 6};

}  // namespace

gimi_handle HandlePool::remove(Kind kind, std::mt19937_64& random) {
  std::vector<gimi_handle>& all = of(kind);
  if (all.empty()) return 0;
  std::swap(all[random() % all.size()], all.back());
  const gimi_handle handle = all.back();
  all.pop_back();
  closed_[closed_count_++ % closed_.size()] = handle;
  return handle;
}

gimi_handle HandlePool::put(gimi_handle handle, std::mt19937_64& random) {
  const std::lock_guard lock(mutex_);
  const Kind kind = kind_of(handle);
  const bool is_full = of(kind).size() >= kMost.at(static_cast<std::size_t>(kind) - 1);
  const gimi_handle gone = is_full ? remove(kind, random) : 0;
  of(kind).push_back(handle);
  return gone;
}

gimi_handle HandlePool::pick(Kind kind, std::mt19937_64& random) {
  const std::lock_guard lock(mutex_);
  const std::vector<gimi_handle>& all = of(kind);
  return all.empty() ? 0 : all[random() % all.size()];
}

gimi_handle HandlePool::take(Kind kind, std::mt19937_64& random) {
  const std::lock_guard lock(mutex_);
  return remove(kind, random);
}

bool HandlePool::drop(gimi_handle handle) {
  const std::lock_guard lock(mutex_);
  return handle != 0 && std::erase(of(kind_of(handle)), handle) != 0;
}

gimi_handle HandlePool::pick_closed(std::mt19937_64& random) {
  const std::lock_guard lock(mutex_);
  return closed_[random() % closed_.size()];
}

std::vector<gimi_handle> HandlePool::take_all(Kind kind) {
  const std::lock_guard lock(mutex_);
  return std::exchange(of(kind), {});
}

std::uint64_t RequestBook::begin(bool repeat) {
  const std::lock_guard lock(mutex_);
  entries_.push_back({});
  entries_.back().repeat = repeat;
  return entries_.size() - 1;
}

void RequestBook::is_pending(gimi_handle pending, std::uint64_t number) {
  const std::lock_guard lock(mutex_);
  EXPECT_TRUE(pending_.emplace(pending, number).second) << "a handle was given twice";
}

void RequestBook::taken(std::uint64_t number) {
  const std::lock_guard lock(mutex_);
  ++entries_.at(number).taken;
}

void RequestBook::ended(std::uint64_t number, gimi_status status, gimi_ran ran) {
  const std::lock_guard lock(mutex_);
  note(number, status, ran);
  ++entries_.at(number).ends;
}

std::uint64_t RequestBook::ended_later(gimi_handle pending, gimi_status status, gimi_ran ran) {
  const std::lock_guard lock(mutex_);
  const std::uint64_t number = pending_.at(pending);
  note(number, status, ran);
  // Another thread may have been given its end, or closed it.
  Entry& entry = entries_.at(number);
  if (status == GIMI_CLOSED) {
    entry.closed = true;
  } else {
    ++entry.ends;
  }
  return number;
}

void RequestBook::closed(gimi_handle handle) {
  const std::lock_guard lock(mutex_);
  const auto found = pending_.find(handle);
  if (found != pending_.end()) entries_.at(found->second).closed = true;
}

void RequestBook::note(std::uint64_t number, gimi_status status, gimi_ran ran) {
  Entry& entry = entries_.at(number);
  entry.said_no |= ran == GIMI_RAN_NO;
  if (ran == GIMI_RAN_NO) entry.words = gimi_error_text();
  entry.said_yes |= ran == GIMI_RAN_YES;
  ++counts_[{status, ran}];
}

std::string RequestBook::check() {
  const std::lock_guard lock(mutex_);
  for (std::size_t number = 0; number < entries_.size(); ++number) {
    const Entry& entry = entries_[number];
    EXPECT_LE(entry.ends, 1u) << "request " << number << " ended twice";
    EXPECT_TRUE(entry.ends != 0 || entry.closed) << "request " << number << " did not end";
    EXPECT_FALSE(entry.said_no && entry.taken != 0)
        << "request " << number << " was done, and said that it was not: " << entry.words;
    EXPECT_FALSE(entry.said_yes && entry.taken == 0)
        << "request " << number << " was not done, and said that it was";
    if (!entry.repeat) {
      EXPECT_LE(entry.taken, 1u) << "request " << number << " was done twice";
    }
  }
  std::string words;
  for (const auto& [what, count] : counts_) {
    words += std::string(gimi_status_text(what.first)) + ", ran " + std::to_string(what.second) +
             ": " + std::to_string(count) + "\n";
  }
  return words;
}

}  // namespace gimnet::stress
