#include "tools/demo/messages.hpp"

#include <cmath>
#include <string_view>
#include <type_traits>

#include "proto/bitestream/reader.hpp"
#include "proto/bitestream/writer.hpp"

namespace gimnet::demo {
namespace {

using proto::bitestream::Reader;
using proto::bitestream::Value;
using proto::bitestream::Writer;

constexpr double kPlausible = 1e9;

// Encoder and Decoder are visited by fields() with each value of a message, in one order for both.
class Encoder {
 public:
  void operator()(std::string_view key, double value) { writer_.put_f64(key, value); }
  void operator()(std::string_view key, std::uint64_t value) { writer_.put_u64(key, value); }
  void operator()(std::string_view key, bool value) { writer_.put_bool(key, value); }
  void operator()(std::string_view key, const std::string& text) { writer_.put_text(key, text); }
  void operator()(std::string_view key, const std::vector<float>& values) {
    writer_.put_array(key, std::span<const float>(values));
  }
  void time(std::string_view key, std::int64_t time_ns) { writer_.put_time(key, time_ns); }

  [[nodiscard]] Bytes bytes() const { return {writer_.bytes().begin(), writer_.bytes().end()}; }

 private:
  Writer writer_;
};

// Remembers whether a value was missing or not as it should be.
class Decoder {
 public:
  explicit Decoder(std::span<const std::byte> bytes) : reader_(bytes) {}

  void operator()(std::string_view key, double& out) {
    take(key, out, [](const Value& value) { return value.as<double>(); });
    good_ = good_ && std::isfinite(out) && std::abs(out) <= kPlausible;
  }
  void operator()(std::string_view key, std::uint64_t& out) {
    take(key, out, [](const Value& value) { return value.as<std::uint64_t>(); });
  }
  void operator()(std::string_view key, bool& out) {
    take(key, out, [](const Value& value) { return value.as_bool(); });
  }
  // A text that is empty is left out by writers.
  void operator()(std::string_view key, std::string& out) {
    if (!reader_.find(key)) return;
    take(key, out, [](const Value& value) { return value.as_text(); });
    good_ = good_ && out.size() <= kInfoTextMax;
  }
  void operator()(std::string_view key, std::vector<float>& out) {
    const std::optional<Value> value = reader_.find(key);
    good_ =
        good_ && value && value->type() == BITESTREAM_F32_ARRAY && value->count() <= kScanBeamsMax;
    for (std::size_t index = 0; good_ && index < value->count(); ++index) {
      const std::optional<Value> element = value->element(index);
      const float range = element ? element->as<float>().value_or(-1.0F) : -1.0F;
      good_ = std::isfinite(range) && range >= 0.0F;
      out.push_back(range);
    }
  }
  void time(std::string_view key, std::int64_t& out) {
    take(key, out, [](const Value& value) { return value.as_time(); });
  }

  [[nodiscard]] bool good() const { return good_; }

 private:
  template <class To, class Read>
  void take(std::string_view key, To& to, const Read& read) {
    const std::optional<Value> value = good_ ? reader_.find(key) : std::nullopt;
    const auto from = value ? read(*value) : std::nullopt;
    good_ = from.has_value();
    if (from) to = To(*from);
  }

  Reader reader_;
  bool good_ = true;
};

void stamp(auto& visit, auto& stamp) {
  visit("n", stamp.number);
  visit.time("t", stamp.made_ns);
}

void pose(auto& visit, auto& pose) {
  visit("x", pose.x_m);
  visit("y", pose.y_m);
  visit("heading", pose.heading_rad);
}

void twist(auto& visit, auto& twist) {
  visit("v", twist.linear_mps);
  visit("w", twist.angular_radps);
}

void fields(auto& visit, auto& message, std::type_identity<Odometry>) {
  stamp(visit, message.stamp);
  pose(visit, message.pose);
  twist(visit, message.twist);
  visit("bumped", message.bumped);
  visit("answers_n", message.answers.number);
  visit.time("answers_t", message.answers.made_ns);
}

void fields(auto& visit, auto& message, std::type_identity<Scan>) {
  stamp(visit, message.stamp);
  pose(visit, message.pose);
  visit("first", message.first_bearing_rad);
  visit("step", message.bearing_step_rad);
  visit("reach", message.range_max_m);
  visit("ranges", message.ranges_m);
}

void fields(auto& visit, auto& message, std::type_identity<RobotInfo>) {
  stamp(visit, message.stamp);
  visit("source", message.source);
  visit("note", message.note);
  visit("map", message.map);
  visit("played", message.played_s);
  visit("duration", message.duration_s);
  visit("speed", message.speed);
  visit("paused", message.paused);
  visit("ended", message.ended);
  visit("odom_total", message.odometry_total);
  visit("scan_total", message.scan_total);
  visit("drive_total", message.drive_total);
}

void fields(auto& visit, auto& message, std::type_identity<DriveCommand>) {
  stamp(visit, message.stamp);
  twist(visit, message.twist);
  visit("speed", message.speed);
  visit("paused", message.paused);
  visit("finish", message.finish);
}

}  // namespace

template <class Message>
Bytes encode(const Message& message) {
  Encoder encoder;
  fields(encoder, message, std::type_identity<Message>{});
  return encoder.bytes();
}

template <class Message>
std::optional<Message> decode(std::span<const std::byte> bytes) {
  Decoder decoder(bytes);
  Message message;
  fields(decoder, message, std::type_identity<Message>{});
  return decoder.good() ? std::optional(std::move(message)) : std::nullopt;
}

template Bytes encode(const Odometry&);
template Bytes encode(const Scan&);
template Bytes encode(const RobotInfo&);
template Bytes encode(const DriveCommand&);
template std::optional<Odometry> decode(std::span<const std::byte>);
template std::optional<Scan> decode(std::span<const std::byte>);
template std::optional<RobotInfo> decode(std::span<const std::byte>);
template std::optional<DriveCommand> decode(std::span<const std::byte>);

}  // namespace gimnet::demo
