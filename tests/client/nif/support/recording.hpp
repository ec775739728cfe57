#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "proto/control/control_message.hpp"
#include "proto/control/link.hpp"
#include "proto/control/ns_watch.hpp"
#include "proto/frame/flow.hpp"
#include "proto/frame/frame_parser.hpp"
#include "tests/vectors/vector_file.hpp"

// Recorded conversations with a hub (tests/vectors/conversation; the form of the files is described
// in tests/system/support/conversation.py).

namespace gimnet::nif::test {

using gimnet::test::Bytes;

/// One frame, or an opening, that somebody sent; no bytes: the connection breaks.
struct Step {
  bool from_hub = false;
  Bytes bytes;

  [[nodiscard]] bool is_break() const { return bytes.empty(); }
  [[nodiscard]] bool is_opening() const { return bytes.size() == proto::kOpeningSize; }
  [[nodiscard]] proto::FrameHeader header() const { return proto::load_header(bytes.data()); }
  /// Valid until: the step goes.
  [[nodiscard]] proto::FrameView view() const {
    return proto::parse_frame(bytes, from_hub ? proto::Origin::hub : proto::Origin::node).value();
  }
  [[nodiscard]] bool is(proto::Kind kind) const {
    return !is_break() && !is_opening() && header().kind == kind;
  }
  [[nodiscard]] bool is_request_kind() const {
    return is(proto::Kind::ns) || is(proto::Kind::ctrl);
  }
  [[nodiscard]] proto::ControlView control() const { return *proto::split_control(view().payload); }
  /// The operation of a control frame, without the bit of answers.
  [[nodiscard]] std::uint16_t operation() const {
    return static_cast<std::uint16_t>(control().header.operation & ~proto::kAnswerBit);
  }
  [[nodiscard]] bool is_answer() const { return is_request_kind() && control().header.is_answer(); }
  template <class Message>
  [[nodiscard]] bool is_about() const {
    return is(proto::Kind::ns) && operation() == Message::kOperation;
  }
  /// Counts in a resume.
  [[nodiscard]] bool is_data() const {
    return !is_break() && !is_opening() && header().kind != proto::Kind::flow &&
           header().kind < proto::Kind::link;
  }
  /// The library sees to these by itself, when it likes; what the hub answers to them is of no use
  /// to it then.
  [[nodiscard]] bool is_of_the_library() const {
    if (is_about<proto::ns::WatchTaken>()) return true;
    return !from_hub && (is(proto::Kind::flow) || is(proto::Kind::taken));
  }
};

[[nodiscard]] inline bool is_goodbye(const Step& step) {
  return step.is(proto::Kind::link) && step.operation() == proto::Goodbye::kOperation;
}

/// The steps of one connection, without openings: from the HELLO on.
using Connection = std::vector<Step>;

inline std::filesystem::path recordings_folder() {
  return std::filesystem::path(GIMNET_VECTORS_DIR) / "conversation";
}

/// Hex digits, in which `00*500` stands for 500 such bytes.
inline std::string spelled_out(const std::string& word) {
  const std::size_t star = word.find('*');
  if (star == std::string::npos) return word;
  std::string hex;
  for (int left = std::stoi(word.substr(star + 1)); left > 0; --left) hex += word.substr(0, star);
  return hex;
}

/// Calls back with (who, step) for each step of a recording.
template <class Take>
void read_recording(const std::string& name, Take take) {
  std::ifstream file(recordings_folder() / (name + ".txt"));
  if (!file) throw std::runtime_error("no recording " + name);
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line.substr(0, line.find('#')));
    std::string who;
    std::string sign;
    std::string hex;
    if (!(words >> who >> sign)) continue;
    for (std::string word; words >> word;) hex += spelled_out(word);
    take(who, Step{sign == "<", gimnet::test::from_hex(hex)});
  }
}

/// The names of those that speak in a recording.
inline std::set<std::string> who_speaks_in(const std::string& name) {
  std::set<std::string> names;
  read_recording(name, [&names](const std::string& who, const Step&) { names.insert(who); });
  return names;
}

/// Drops what a node that came back had not got: that broke off with its connection.
inline void lose_what_was_not_taken(Connection& broken, const proto::Hello& next) {
  if (broken.empty() || !broken.back().is_break()) return;
  std::uint64_t taken = 0;
  std::erase_if(broken, [&](const Step& step) {
    return step.from_hub && step.is_data() && ++taken > next.resume_taken;
  });
}

/// The connections of a node, one after the other. `who`: the node's names in the recording.
inline std::vector<Connection> connections_of(const std::string& name,
                                              const std::vector<std::string>& who) {
  std::vector<Connection> connections;
  for (const std::string& each : who) {
    Connection connection;
    read_recording(name, [&](const std::string& speaker, const Step& step) {
      if (speaker == each && !step.is_opening()) connection.push_back(step);
    });
    if (connection.empty()) throw std::runtime_error("nobody is called " + each + " in " + name);
    if (!connections.empty()) {
      lose_what_was_not_taken(connections.back(),
                              proto::decode<proto::Hello>(connection[0].view().payload).value());
    }
    connections.push_back(std::move(connection));
  }
  return connections;
}

/// Puts the parts of a message together.
class Parts {
 public:
  /// The whole message's payload, or nothing if more parts follow.
  [[nodiscard]] std::optional<Bytes> add(const proto::FrameView& view) {
    gathered_.insert(gathered_.end(), view.payload.begin(), view.payload.end());
    if (!view.ends_message()) return std::nullopt;
    return std::exchange(gathered_, {});
  }

 private:
  Bytes gathered_;
};

}  // namespace gimnet::nif::test
