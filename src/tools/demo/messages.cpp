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
    const std::optional<Value> value = take(key);
    const std::optional<double> number = value ? value->as<double>() : std::nullopt;
    keep(number && std::isfinite(*number) && std::abs(*number) <= kPlausible, number, out);
  }
  void operator()(std::string_view key, std::uint64_t& out) {
    const std::optional<Value> value = take(key);
    const std::optional<std::uint64_t> number = value ? value->as<std::uint64_t>() : std::nullopt;
    keep(number.has_value(), number, out);
  }
  void operator()(std::string_view key, bool& out) {
    const std::optional<Value> value = take(key);
    const std::optional<bool> flag = value ? value->as_bool() : std::nullopt;
    keep(flag.has_value(), flag, out);
  }
  // A text that is empty is left out by writers.
  void operator()(std::string_view key, std::string& out) {
    const std::optional<Value> value = reader_.find(key);
    if (!value) return;
    const std::optional<std::string_view> text = value->as_text();
    keep(text && text->size() <= kInfoTextMax, text, out);
  }
  void operator()(std::string_view key, std::vector<float>& out) {
    const std::optional<Value> value = take(key);
    good_ =
        good_ && value && value->type() == BITESTREAM_F32_ARRAY && value->count() <= kScanBeamsMax;
    if (!good_) return;
    out.reserve(value->count());
    for (std::size_t index = 0; index < value->count(); ++index) {
      const std::optional<Value> element = value->element(index);
      const std::optional<float> number = element ? element->as<float>() : std::nullopt;
      good_ = good_ && number && std::isfinite(*number) && *number >= 0.0F;
      out.push_back(number.value_or(0.0F));
    }
  }
  void time(std::string_view key, std::int64_t& out) {
    const std::optional<Value> value = take(key);
    const std::optional<std::int64_t> time = value ? value->as_time() : std::nullopt;
    keep(time.has_value(), time, out);
  }

  [[nodiscard]] bool good() const { return good_; }

 private:
  std::optional<Value> take(std::string_view key) {
    return good_ ? reader_.find(key) : std::nullopt;
  }

  template <class From, class To>
  void keep(bool fits, const std::optional<From>& from, To& to) {
    good_ = good_ && fits;
    if (good_) to = To(*from);
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

template <class Message>
Bytes encoded(const Message& message) {
  Encoder encoder;
  fields(encoder, message, std::type_identity<Message>{});
  return encoder.bytes();
}

template <class Message>
std::optional<Message> decoded(std::span<const std::byte> bytes) {
  Decoder decoder(bytes);
  Message message;
  fields(decoder, message, std::type_identity<Message>{});
  return decoder.good() ? std::optional(std::move(message)) : std::nullopt;
}

}  // namespace

Bytes encode(const Odometry& message) { return encoded(message); }
Bytes encode(const Scan& message) { return encoded(message); }
Bytes encode(const RobotInfo& message) { return encoded(message); }
Bytes encode(const DriveCommand& message) { return encoded(message); }

std::optional<Odometry> decode_odometry(std::span<const std::byte> bytes) {
  return decoded<Odometry>(bytes);
}
std::optional<Scan> decode_scan(std::span<const std::byte> bytes) { return decoded<Scan>(bytes); }
std::optional<RobotInfo> decode_info(std::span<const std::byte> bytes) {
  return decoded<RobotInfo>(bytes);
}
std::optional<DriveCommand> decode_drive(std::span<const std::byte> bytes) {
  return decoded<DriveCommand>(bytes);
}

}  // namespace gimnet::demo
