// Pictures as inline SVG, drawn by gnuplot in a child process. Texts are the program's own, never the file's.
#pragma once

#include <array>
#include <chrono>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

namespace ferrobench::recordings {

struct Series {
  std::string label;                          // "" for none
  std::vector<std::array<double, 2>> points;  // NaN breaks the line
  double value = NAN;  // its place between the first and the last colour; NaN: its place in the list
  bool quiet = false;  // grey, behind the others
};

// Values over a grid, in colours from blue over grey (0) to orange; NaN stays empty.
struct Map {
  std::vector<double> x, y;
  std::vector<std::vector<double>> z;  // [y][x]
  std::string label;
};

struct Figure {
  std::string title, x_label, y_label;
  bool log_x = false;
  bool square = false;  // loops, and what stands two in a row; else wide and low
  std::vector<Series> series;
  std::optional<Map> map = {};  // in place of series
  std::string note = {};        // what the reader must know of the drawing, "" for nothing
};

struct Drawing {
  std::vector<std::string> svg;  // one per figure; empty if there was a problem
  std::string problem;
};

// Lines and letters take the colour of the text around them.
// The child gets no descriptor of this process, 1 GiB of memory, and as much time as the limit says.
Drawing draw(const std::vector<Figure>& figures, const std::string& gnuplot = "gnuplot",
             std::chrono::seconds limit = std::chrono::seconds(10));

}  // namespace ferrobench::recordings
