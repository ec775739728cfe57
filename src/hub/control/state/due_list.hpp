#pragma once

#include <algorithm>
#include <cstddef>
#include <deque>
#include <utility>

namespace gimnet::hub {

/// Notes of what is due when, the next one first. Others make notes void before they are due: a
/// node that was away comes back. Void notes are forgotten once there are more of them than of the
/// others, so that who causes many in no time costs no memory. Thread safety: none. Limits: twice
/// as many notes as can be valid, and kVoidMost.
template <class Note>
class DueList {
 public:
  static constexpr std::size_t kVoidMost = 64;

  /// Adds a note that is due after all others. At most `valid_most` notes, this one among them, are
  /// valid now; `is_void(note)` tells which are not. Amortized constant time.
  template <class IsVoid>
  void add(Note note, std::size_t valid_most, IsVoid&& is_void) {
    notes_.push_back(std::move(note));
    if (notes_.size() > 2 * valid_most + kVoidMost) std::erase_if(notes_, is_void);
  }

  [[nodiscard]] bool empty() const { return notes_.empty(); }
  [[nodiscard]] std::size_t size() const { return notes_.size(); }
  /// REQUIRES: not empty.
  [[nodiscard]] const Note& front() const { return notes_.front(); }
  /// REQUIRES: not empty.
  void pop_front() { notes_.pop_front(); }
  /// All are due later by that, at the latest at `latest`: in the same order. REQUIRES: Note::until
  /// says when it is due.
  template <class Time>
  void put_off(Time by, Time latest) {
    for (Note& note : notes_) note.until = std::min(note.until + by, latest);
  }
  [[nodiscard]] auto begin() { return notes_.begin(); }
  [[nodiscard]] auto end() { return notes_.end(); }

 private:
  std::deque<Note> notes_;  ///< Limit: see add()
};

}  // namespace gimnet::hub
