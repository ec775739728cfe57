#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "base/clock.hpp"
#include "tests/sim/scale/scale_net.hpp"

// ./dev scale: how the routes and names of a network grow. See tests/sim/README.md.

namespace gimnet::sim::scale {
namespace {

constexpr const char* kUsage =
    "usage: gimnet-sim-scale [--quick] [--json] [--plot FILE]\n"
    "  --quick      small networks\n"
    "  --json       the table as JSON\n"
    "  --plot FILE  an SVG of how the meshes grow\n";
constexpr std::uint64_t kSeed = 17;
constexpr std::size_t kWholeOfAStar = 32;

struct Row {
  Shape shape;
  Figures figures;
  double wall_s = 0;

  [[nodiscard]] double each(std::uint64_t sum) const {
    return static_cast<double>(sum) / static_cast<double>(shape.hubs);
  }
  [[nodiscard]] double memory_each() const {
    return static_cast<double>(figures.memory_bytes) / static_cast<double>(figures.wholes);
  }
};

std::vector<Shape> shapes(bool quick) {
  std::vector<Shape> all;
  for (const std::size_t hubs : {10, 100, 1'000}) {
    if (quick && hubs > 100) continue;
    all.push_back({"mesh", hubs, 10, mesh(hubs, kSeed), 0});
  }
  const std::size_t robots = quick ? 400 : 4'000;
  all.push_back({"star", robots, 0, star(robots), kWholeOfAStar});
  all.push_back({"names", 16, std::size_t{quick ? 625u : 62'500u}, mesh(16, kSeed), 0});
  return all;
}

Row measure(const Shape& shape) {
  const std::int64_t begun = steady_now_ns();
  Row row{shape, ScaleNet(shape, kSeed).measure(), 0};
  row.wall_s = static_cast<double>(steady_now_ns() - begun) / 1e9;
  return row;
}

constexpr const char* kNote =
    "Simulated: computing takes no time, a link 1 ms, and all hubs start at once. In a star 32 "
    "hubs are simulated whole; the others say their record, and what comes to them is counted.";

void print_table(const std::vector<Row>& rows) {
  std::printf("%-6s %6s %8s %6s %12s %11s %12s %13s %12s %12s %7s\n", "", "hubs", "names", "links",
              "converged", "re-route", "start", "one change", "idle", "memory", "took");
  std::printf("%-6s %6s %8s %6s %12s %11s %12s %13s %12s %12s %7s\n", "", "", "", "", "ms", "ms",
              "bytes/hub", "bytes/hub", "bytes/s/hub", "bytes/hub", "s");
  for (const Row& row : rows) {
    std::printf("%-6s %6zu %8zu %6zu %12lld %11lld %12.0f %13.0f %12.0f %12.0f %7.1f\n",
                row.shape.name, row.shape.hubs, row.shape.names * row.shape.hubs,
                row.shape.links.size(), static_cast<long long>(row.figures.converged.count()),
                static_cast<long long>(row.figures.rerouted.count()),
                row.each(row.figures.start_bytes), row.each(row.figures.change_bytes),
                row.each(row.figures.idle_bytes_per_s), row.memory_each(), row.wall_s);
  }
  std::printf("%s\n", kNote);
}

void print_json(const std::vector<Row>& rows) {
  std::printf("{\"note\":\"%s\",\"rows\":[", kNote);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row& row = rows[i];
    std::printf(
        "%s\n {\"network\":\"%s\",\"hubs\":%zu,\"whole\":%zu,\"names\":%zu,\"links\":%zu,"
        "\"converged_ms\":%lld,\"rerouted_ms\":%lld,\"start_bytes_per_hub\":%.0f,"
        "\"change_bytes_per_hub\":%.0f,\"idle_bytes_per_s_and_hub\":%.0f,"
        "\"memory_bytes_per_hub\":%.0f,\"messages\":%" PRIu64 ",\"took_s\":%.1f}",
        i == 0 ? "" : ",", row.shape.name, row.shape.hubs, row.figures.wholes,
        row.shape.names * row.shape.hubs, row.shape.links.size(),
        static_cast<long long>(row.figures.converged.count()),
        static_cast<long long>(row.figures.rerouted.count()), row.each(row.figures.start_bytes),
        row.each(row.figures.change_bytes), row.each(row.figures.idle_bytes_per_s),
        row.memory_each(), row.figures.messages, row.wall_s);
  }
  std::printf("\n]}\n");
}

/// One panel of the plot: hubs to the right, the figure upwards, both by powers of ten.
class Panel {
 public:
  Panel(std::FILE* file, int number, const char* title) : file_(file), left_(70 + 300 * number) {
    std::fprintf(file_, "<text x=\"%d\" y=\"24\">%s</text>\n", left_, title);
    std::fprintf(file_,
                 "<rect x=\"%d\" y=\"%d\" width=\"%d\" height=\"%d\" fill=\"none\" "
                 "stroke=\"#888\"/>\n",
                 left_, kTop, kWidth, kHeight);
  }
  void draw(const std::vector<std::pair<double, double>>& points) const {
    std::string line;
    for (const auto& [hubs, value] : points) {
      const double x = left_ + (std::log10(hubs) - 1) * kWidth / kDecadesOfHubs;
      const double y = kTop + kHeight - std::log10(value) * kHeight / kDecades;
      line += std::to_string(x) + "," + std::to_string(y) + " ";
      std::fprintf(file_, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"3\"/>\n", x, y);
      std::fprintf(file_, "<text x=\"%.1f\" y=\"%.1f\" font-size=\"11\">%.0f</text>\n", x - 12,
                   y - 8, value);
      std::fprintf(file_, "<text x=\"%.1f\" y=\"%d\" font-size=\"11\">%.0f</text>\n", x - 8,
                   kTop + kHeight + 16, hubs);
    }
    std::fprintf(file_, "<polyline points=\"%s\" fill=\"none\" stroke=\"#06c\"/>\n", line.c_str());
  }

 private:
  static constexpr int kTop = 40;
  static constexpr int kWidth = 220;
  static constexpr int kHeight = 220;
  static constexpr double kDecadesOfHubs = 2.3;
  static constexpr double kDecades = 8;
  std::FILE* const file_;
  const int left_;
};

bool write_plot(const char* path, const std::vector<Row>& rows) {
  std::FILE* const file = std::fopen(path, "w");
  if (file == nullptr) return false;
  std::fprintf(file,
               "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"940\" height=\"300\" "
               "font-family=\"sans-serif\" font-size=\"13\">\n");
  std::vector<std::pair<double, double>> converged;
  std::vector<std::pair<double, double>> bytes;
  std::vector<std::pair<double, double>> memory;
  for (const Row& row : rows) {
    if (std::strcmp(row.shape.name, "mesh") != 0) continue;
    const auto hubs = static_cast<double>(row.shape.hubs);
    converged.emplace_back(hubs, static_cast<double>(row.figures.converged.count()));
    bytes.emplace_back(hubs, row.each(row.figures.start_bytes));
    memory.emplace_back(hubs, row.memory_each());
  }
  Panel(file, 0, "converged, ms, by hubs").draw(converged);
  Panel(file, 1, "control bytes of a hub until then").draw(bytes);
  Panel(file, 2, "memory of a hub, bytes").draw(memory);
  std::fprintf(file, "</svg>\n");
  return std::fclose(file) == 0;
}

int run(int count, char** texts) {
  bool quick = false;
  bool json = false;
  const char* plot = nullptr;
  for (int at = 1; at < count; ++at) {
    const std::string_view flag = texts[at];
    if (flag == "--quick") {
      quick = true;
    } else if (flag == "--json") {
      json = true;
    } else if (flag == "--plot" && at + 1 < count) {
      plot = texts[++at];
    } else {
      std::fputs(kUsage, flag == "--help" ? stdout : stderr);
      return flag == "--help" ? 0 : 2;
    }
  }
  std::vector<Row> rows;
  for (const Shape& shape : shapes(quick)) rows.push_back(measure(shape));
  if (json) {
    print_json(rows);
  } else {
    print_table(rows);
  }
  if (plot != nullptr && !write_plot(plot, rows)) {
    std::fprintf(stderr, "gimnet-sim-scale: cannot write %s\n", plot);
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace gimnet::sim::scale

int main(int count, char** texts) { return gimnet::sim::scale::run(count, texts); }
