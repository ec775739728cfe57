#include "tools/demo/messages.hpp"

#include <cmath>
#include <string_view>

#include "proto/bitestream/reader.hpp"
#include "proto/bitestream/writer.hpp"

namespace gimnet::demo {
namespace {

using proto::bitestream::Reader;
using proto::bitestream::Value;
using proto::bitestream::Writer;

constexpr double kPlausible = 1e9;

Bytes taken_from(const Writer& writer) { return {writer.bytes().begin(), writer.bytes().end()}; }

void put(Writer& writer, const Stamp& stamp) {
  writer.put_u64("n", stamp.number);
  writer.put_time("t", stamp.made_ns);
}

void put(Writer& writer, const Pose& pose) {
  writer.put_f64("x", pose.x_m);
  writer.put_f64("y", pose.y_m);
  writer.put_f64("heading", pose.heading_rad);
}

void put(Writer& writer, const Twist& twist) {
  writer.put_f64("v", twist.linear_mps);
  writer.put_f64("w", twist.angular_radps);
}

// Reads values in the order in which they were written, and remembers whether one was missing or
// not as it should be.
class Decoder {
 public:
  explicit Decoder(std::span<const std::byte> bytes) : reader_(bytes) {}

  void get(std::string_view key, double& out) {
    const std::optional<Value> value = take(key);
    const std::optional<double> number = value ? value->as<double>() : std::nullopt;
    keep(number && std::isfinite(*number) && std::abs(*number) <= kPlausible, number, out);
  }
  void get(std::string_view key, std::uint64_t& out) {
    const std::optional<Value> value = take(key);
    const std::optional<std::uint64_t> number = value ? value->as<std::uint64_t>() : std::nullopt;
    keep(number.has_value(), number, out);
  }
  void get(std::string_view key, bool& out) {
    const std::optional<Value> value = take(key);
    const std::optional<bool> flag = value ? value->as_bool() : std::nullopt;
    keep(flag.has_value(), flag, out);
  }
  void get_time(std::string_view key, std::int64_t& out) {
    const std::optional<Value> value = take(key);
    const std::optional<std::int64_t> time = value ? value->as_time() : std::nullopt;
    keep(time.has_value(), time, out);
  }
  // A text that is empty is left out by writers.
  void get_text(std::string_view key, std::string& out) {
    const std::optional<Value> value = reader_.find(key);
    if (!value) return;
    const std::optional<std::string_view> text = value->as_text();
    keep(text && text->size() <= kInfoTextMax, text, out);
  }
  void get(std::string_view key, std::vector<float>& out) {
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
  void get(Stamp& stamp) {
    get("n", stamp.number);
    get_time("t", stamp.made_ns);
  }
  void get(Pose& pose) {
    get("x", pose.x_m);
    get("y", pose.y_m);
    get("heading", pose.heading_rad);
  }
  void get(Twist& twist) {
    get("v", twist.linear_mps);
    get("w", twist.angular_radps);
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

}  // namespace

Bytes encode(const Odometry& message) {
  Writer writer;
  put(writer, message.stamp);
  put(writer, message.pose);
  put(writer, message.twist);
  writer.put_bool("bumped", message.bumped);
  writer.put_u64("answers_n", message.answers.number);
  writer.put_time("answers_t", message.answers.made_ns);
  return taken_from(writer);
}

Bytes encode(const Scan& message) {
  Writer writer;
  put(writer, message.stamp);
  put(writer, message.pose);
  writer.put_f64("first", message.first_bearing_rad);
  writer.put_f64("step", message.bearing_step_rad);
  writer.put_f64("reach", message.range_max_m);
  writer.put_array("ranges", std::span<const float>(message.ranges_m));
  return taken_from(writer);
}

Bytes encode(const RobotInfo& message) {
  Writer writer;
  put(writer, message.stamp);
  writer.put_text("source", message.source);
  writer.put_text("note", message.note);
  writer.put_text("map", message.map);
  writer.put_f64("played", message.played_s);
  writer.put_f64("duration", message.duration_s);
  writer.put_f64("speed", message.speed);
  writer.put_bool("paused", message.paused);
  writer.put_bool("ended", message.ended);
  writer.put_u64("odom_total", message.odometry_total);
  writer.put_u64("scan_total", message.scan_total);
  writer.put_u64("drive_total", message.drive_total);
  return taken_from(writer);
}

Bytes encode(const DriveCommand& message) {
  Writer writer;
  put(writer, message.stamp);
  put(writer, message.twist);
  writer.put_f64("speed", message.speed);
  writer.put_bool("paused", message.paused);
  writer.put_bool("finish", message.finish);
  return taken_from(writer);
}

std::optional<Odometry> decode_odometry(std::span<const std::byte> bytes) {
  Decoder decoder(bytes);
  Odometry message;
  decoder.get(message.stamp);
  decoder.get(message.pose);
  decoder.get(message.twist);
  decoder.get("bumped", message.bumped);
  decoder.get("answers_n", message.answers.number);
  decoder.get_time("answers_t", message.answers.made_ns);
  return decoder.good() ? std::optional(message) : std::nullopt;
}

std::optional<Scan> decode_scan(std::span<const std::byte> bytes) {
  Decoder decoder(bytes);
  Scan message;
  decoder.get(message.stamp);
  decoder.get(message.pose);
  decoder.get("first", message.first_bearing_rad);
  decoder.get("step", message.bearing_step_rad);
  decoder.get("reach", message.range_max_m);
  decoder.get("ranges", message.ranges_m);
  return decoder.good() ? std::optional(std::move(message)) : std::nullopt;
}

std::optional<RobotInfo> decode_info(std::span<const std::byte> bytes) {
  Decoder decoder(bytes);
  RobotInfo message;
  decoder.get(message.stamp);
  decoder.get_text("source", message.source);
  decoder.get_text("note", message.note);
  decoder.get_text("map", message.map);
  decoder.get("played", message.played_s);
  decoder.get("duration", message.duration_s);
  decoder.get("speed", message.speed);
  decoder.get("paused", message.paused);
  decoder.get("ended", message.ended);
  decoder.get("odom_total", message.odometry_total);
  decoder.get("scan_total", message.scan_total);
  decoder.get("drive_total", message.drive_total);
  return decoder.good() ? std::optional(std::move(message)) : std::nullopt;
}

std::optional<DriveCommand> decode_drive(std::span<const std::byte> bytes) {
  Decoder decoder(bytes);
  DriveCommand message;
  decoder.get(message.stamp);
  decoder.get(message.twist);
  decoder.get("speed", message.speed);
  decoder.get("paused", message.paused);
  decoder.get("finish", message.finish);
  return decoder.good() ? std::optional(message) : std::nullopt;
}

}  // namespace gimnet::demo
