#include "recordings/reports/plot.h"

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <system_error>
#include <thread>

#include "base/number_text.h"
#include "recordings/process/child.h"
#include "recordings/reports/table.h"

namespace ferrobench::recordings {
namespace {

class ScratchFolder {
 public:
  ScratchFolder() {
    std::error_code ignored;
    auto name = (std::filesystem::temp_directory_path(ignored) / "ferrobench-XXXXXX").string();
    if (mkdtemp(name.data()) != nullptr) path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    if (!path_.empty()) std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  bool made() const { return !path_.empty(); }
  std::string file(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

void write_points(const std::string& path, const Series& series) {
  std::ofstream out(path);
  for (const auto& [x, y] : series.points) {
    if (std::isnan(x) || std::isnan(y)) {
      out << '\n';
    } else {
      out << number_in_full(x) << ' ' << number_in_full(y) << '\n';
    }
  }
}

void write_map(const std::string& path, const Map& map) {
  std::ofstream out(path);
  for (std::size_t row = 0; row < map.y.size(); ++row) {
    for (std::size_t column = 0; column < map.x.size(); ++column) {
      const double z = map.z[row][column];
      out << number_in_full(map.x[column]) << ' ' << number_in_full(map.y[row]) << ' '
          << (std::isnan(z) ? "NaN" : number_in_full(z)) << '\n';
    }
    out << '\n';
  }
}

std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("''") : std::string(1, c);
  return out + "'";
}

// From blue over violet to orange, all readable on white and on black.
std::vector<int> colours_of(const std::vector<Series>& series) {
  constexpr int quiet = 0x888888;
  std::vector<double> places;
  for (const auto& s : series)
    if (!s.quiet) places.push_back(std::isnan(s.value) ? static_cast<double>(places.size()) : s.value);
  std::vector<int> out;
  if (places.empty()) return std::vector<int>(series.size(), quiet);
  const auto [low, high] = std::ranges::minmax(places);
  auto place = places.begin();
  for (const auto& s : series) {
    if (s.quiet) {
      out.push_back(quiet);
      continue;
    }
    const double hue = high > low ? (*place - low) / (high - low) : 0;
    ++place;
    const auto mix = [&](int from, int to) {
      return static_cast<int>(std::lround(from + hue * (to - from)));
    };
    out.push_back(mix(0x2f, 0xe0) << 16 | mix(0x7f, 0x70) << 8 | mix(0xd8, 0x20));
  }
  return out;
}

// Between the numbers along a narrow axis: 1, 2 or 5 times a power of ten, six numbers or so. gnuplot's own
// choice runs together where they have many digits. "autofreq" leaves it the choice.
std::string x_step(const Figure& figure) {
  double low = INFINITY, high = -INFINITY;
  for (const auto& s : figure.series)
    for (const auto& [x, y] : s.points) {
      if (!std::isfinite(x)) continue;
      low = std::min(low, x);
      high = std::max(high, x);
    }
  if (!figure.square || figure.log_x || !(high > low)) return "autofreq";
  constexpr double most = 6.5;  // a little more than six, as noise makes a range longer
  const double power = std::pow(10, std::floor(std::log10((high - low) / most)));
  for (const double times : {1.0, 2.0, 5.0})
    if ((high - low) / (times * power) <= most) return number_in_full(times * power);
  return number_in_full(10 * power);
}

// How a logarithmic axis is numbered: by powers of ten, as decimals of many decades run into each other.
std::string x_format(const Figure& figure) {
  return figure.log_x ? "'10^{%L}'" : "'% h'";
}

std::string script(const std::vector<Figure>& figures, const ScratchFolder& folder) {
  std::string out =
      "set encoding utf8\nset grid lc rgb '#a0a0a0' lw 0.4\nset border 3 lw 0.8\nset tics nomirror\n"
      "set key noenhanced samplen 1.5\nset style data lines\nset autoscale xfix\n";
  for (std::size_t k = 0; k < figures.size(); ++k) {
    const auto& figure = figures[k];
    const auto number = std::to_string(k);
    std::size_t labels = 0, longest = 0;
    for (const auto& s : figure.series) {
      labels += s.label.empty() ? 0 : 1;
      longest = std::max(longest, s.label.size());
    }
    const bool keyed = labels > 0;
    // Names that would take half of the picture stand below it, two in a line.
    constexpr std::size_t short_name = 12, line = 17;  // bytes; pixels
    const bool below = figure.square && longest > short_name;
    const auto height = 360 + (below ? line * ((labels + 1) / 2 + 1) : 0);
    // The time axes of wide figures lie below each other.
    out += figure.square ? "set terminal svg size 460," + std::to_string(height)
                         : "set terminal svg size 940,220";
    out += " dynamic font 'sans-serif,12' name 'figure" + number + "'\n";
    out += figure.square ? std::string("unset lmargin\nunset rmargin\n")
                         : std::string("set lmargin at screen 0.1\nset rmargin at screen ") +
                               (keyed ? "0.8\n" : "0.98\n");
    out += "set output " + quoted(folder.file(number + ".svg")) + '\n';
    // The empty title keeps the names apart from what the axis is called.
    out += below ? "set key outside center bottom horizontal maxcols 2 title ' '\n"
                 : "set key outside right top vertical maxcols auto title ''\n";
    out += figure.log_x ? "set logscale x\n" : "unset logscale x\n";
    out += "set format x " + x_format(figure) + "\nset xtics " + x_step(figure) + '\n';
    out += "set xlabel " + quoted(figure.x_label) + " noenhanced\nset ylabel " + quoted(figure.y_label) +
           " noenhanced\n";
    if (figure.map) {
      double largest = 0;
      for (const auto& row : figure.map->z)
        for (const double z : row)
          if (!std::isnan(z)) largest = std::max(largest, std::abs(z));
      const auto name = folder.file(number + "_map.txt");
      write_map(name, *figure.map);
      const auto range = number_in_full(largest > 0 ? largest : 1);
      out +=
          "set pm3d map corners2color mean\nset palette defined (-1 '#2f7fd8', 0 '#d8d8d8', 1 '#e07020')\n";
      out.append("set cbrange [-").append(range).append(":").append(range).append("]\nset cblabel ");
      out.append(quoted(figure.map->label)).append(" noenhanced\n");
      out += "splot " + quoted(name) + " using 1:2:3 with pm3d notitle\nunset pm3d\n";
      continue;
    }
    out += "plot ";
    const auto colours = colours_of(figure.series);
    for (std::size_t i = 0; i < figure.series.size(); ++i) {
      const auto name = number + "_" + std::to_string(i) + ".txt";
      write_points(folder.file(name), figure.series[i]);
      out += (i > 0 ? ", " : "") + quoted(folder.file(name)) + " lw 1.3 lc rgb " +
             std::to_string(colours[i]) +
             (figure.series[i].label.empty() ? " notitle" : " title " + quoted(figure.series[i].label));
    }
    out += '\n';
  }
  return out + "set output\n";
}

constexpr std::string_view child_name = "ferrobench: draws";

// As the child. gnuplot may start processes of its own, and they have the same limits.
[[gnu::constructor]] void draw_if_asked(int argc, char** argv) {
  if (argc != 4 || argv[0] != child_name) return;
  constexpr rlim_t memory = 1 << 30, picture = 64 << 20;
  be_a_child();
  allow(RLIMIT_CPU, static_cast<rlim_t>(std::strtol(argv[3], nullptr, 10)));
  allow(RLIMIT_AS, memory);
  allow(RLIMIT_FSIZE, picture);
  execlp(argv[1], argv[1], argv[2], nullptr);
  _exit(127);
}

// What went wrong, or "". No shell, no input, nothing printed.
std::string run(const std::string& program, const std::string& script, std::chrono::seconds limit) {
  const auto seconds = std::to_string(limit.count());
  try {
    Child child(std::array{std::string(child_name), program, script, seconds});
    for (const auto end = std::chrono::steady_clock::now() + limit; !child.over();) {
      if (std::chrono::steady_clock::now() > end) return "gnuplot took longer than " + seconds + " s";
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    const int status = child.end();
    if (WIFEXITED(status) && WEXITSTATUS(status) == 127) return "gnuplot is not installed";
    return WIFEXITED(status) && WEXITSTATUS(status) == 0 ? "" : "gnuplot failed";
  } catch (const std::system_error& failure) {
    return "gnuplot could not be started: " + failure.code().message();
  }
}

void replace_all(std::string& text, std::string_view what, std::string_view by) {
  for (auto at = text.find(what); at != std::string::npos; at = text.find(what, at + by.size()))
    text.replace(at, what.size(), by);
}

std::string read_svg(const std::string& path) {
  std::ifstream in(path);
  std::string text{std::istreambuf_iterator<char>(in), {}};
  const auto start = text.find("<svg");
  if (start == std::string::npos || text.find("</svg>") == std::string::npos) return "";
  text.erase(0, start);
  if (const auto name = text.find("<title>"); name != std::string::npos)  // it would show as a tooltip
    text.erase(name, text.find("</title>") + 8 - name);
  replace_all(text, "color=\"black\"", "color=\"inherit\"");
  replace_all(text, "stroke='black'", "stroke='currentColor'");
  replace_all(text, "fill=\"black\"", "fill=\"currentColor\"");
  replace_all(text, "rgb(  0,   0,   0)", "currentColor");
  return text;
}

}  // namespace

Drawing draw(const std::vector<Figure>& figures, const std::string& gnuplot, std::chrono::seconds limit) {
  const ScratchFolder folder;
  if (!folder.made()) return {.svg = {}, .problem = "there is no room for temporary files"};
  std::ofstream(folder.file("script.gp")) << script(figures, folder);
  Drawing out{.svg = {}, .problem = run(gnuplot, folder.file("script.gp"), limit)};
  if (!out.problem.empty()) return out;
  for (std::size_t k = 0; k < figures.size(); ++k)
    out.svg.push_back(read_svg(folder.file(std::to_string(k) + ".svg")));
  if (std::ranges::find(out.svg, "") != out.svg.end()) return {.svg = {}, .problem = "gnuplot failed"};
  return out;
}

}  // namespace ferrobench::recordings
