// What one table holds, in SI units and by what it is, whoever wrote it: between reading and a recording.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "recordings/exchange/testers/findings.h"
#include "recordings/format/recording.h"

namespace ferrobench::recordings {

using Values = std::vector<double>;

struct Measured {
  Values time;  // s
  // m^2, by which the source divided a charge or a current. The specimen's may be another one: whoever knows
  // better than the file does not change what was measured.
  double area = 1;
  std::optional<Values> voltage{};  // V
  std::array<std::optional<Values>, 5> channels{};
  std::optional<Values> current{};       // A
  std::optional<Values> polarization{};  // C/m^2, of the charge over `area`
  std::vector<OtherColumn> others{};
  std::vector<std::size_t> blocks{};  // rows before which nothing was sampled for a while
  std::function<std::string(std::size_t row)> place_of{};  // "line 84"

  // What the program asked for, where the source says it.
  std::optional<double> amplitude{};  // V, of both signs
  std::optional<double> frequency{};  // Hz, of one loop
  bool conducts = false;  // the current is that through the specimen, not that of its polarization
  bool returns = false;   // the program is a tester's, which ends where it began
  Findings findings{};

  std::optional<Values>& channel(Channel c) { return channels.at(static_cast<std::size_t>(c)); }
  const std::optional<Values>& channel(Channel c) const { return channels.at(static_cast<std::size_t>(c)); }
  void say(std::string kind, std::string message, double at = 0) {
    findings.push_back({std::move(kind), std::move(message), at});
  }
  std::string place(std::size_t row) const {
    return place_of ? place_of(row) : "row " + std::to_string(row + 1);
  }
};

}  // namespace ferrobench::recordings
