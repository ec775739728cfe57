#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "fuzz/hub/control/support/control_hub.hpp"
#include "fuzz/hub/control/support/reference.hpp"
#include "fuzz/support/fuzz_input.hpp"

namespace gimnet::fuzz {

/// A hub and the reference, led through the same operations, which are read from the input:
/// whatever the order, they agree after each. Ends in an abort where they do not.
class ControlRun {
 public:
  /// The first byte chooses the limits.
  explicit ControlRun(Choices& input);

  /// One operation, chosen and filled in from the input.
  using Step = void (*)(ControlRun&, Choices&);
  /// What a fuzz target does with its input: a run of such steps until nothing is left of it, then
  /// finish().
  static void of_input(const std::uint8_t* data, std::size_t size, Step step);

  // Operations; what they are about is read from the input.
  void join(Choices& input);
  void end(Choices& input);
  void pass(Choices& input);
  void serve(Choices& input);
  void ask_names(Choices& input);
  void ask_services(Choices& input);
  void ask_watches(Choices& input);
  void ask_anything(Choices& input);
  void ask_control(Choices& input);
  void administer(Choices& input);
  void drain();

  /// Everybody is told everything, and leaves: nothing is left of them.
  void finish();

 private:
  void take_in(const Stranger& stranger);
  [[nodiscard]] Line* pick(Choices& input);
  void ask(const Line& line, proto::Kind kind, std::span<const std::byte> payload, NodeId dst = {});
  template <class Message>
  void ask(Choices& input, proto::Kind kind, const Message& message) {
    if (const Line* line = pick(input)) ask(*line, kind, proto::encode(message, ++request_));
  }
  void note_tokens(std::span<const std::byte> answer);
  void keep_token(const std::vector<std::byte>& token);
  void hear_of_ends();
  void compare();
  bool serve_once();
  void settle();

  [[nodiscard]] NodeId some_node(Choices& input) const;
  [[nodiscard]] GroupId some_group(Choices& input) const;
  [[nodiscard]] std::vector<std::byte> some_proof(std::uint32_t group);
  [[nodiscard]] hub::Reloading some_configuration(Choices& input) const;
  void advertise(Choices& input);
  void subscribe(Choices& input);
  void watch(Choices& input);
  void reload(Choices& input);
  void set_level(Choices& input);

  ControlHub hub_;
  Reference reference_;
  std::vector<Line> lines_;
  std::vector<std::vector<std::byte>> tokens_;
  std::uint16_t request_ = 0;
  std::uint32_t strangers_ = 0;
};

/// A name of a few that collide, or bytes of the input.
[[nodiscard]] std::string some_name(Choices& input);
[[nodiscard]] std::string some_pattern(Choices& input);

}  // namespace gimnet::fuzz
