#include "model/inference/report/empirical_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "model/effects/catalogue.h"
#include "model/inference/report/picture_axis.h"

namespace ferrobench::model {
namespace {

constexpr int steps = 200;  // of a quarter of the cycle

// Triangular, from nothing to the scale, to its negative and back, twice; the second round is drawn.
std::vector<double> cycle(double scale) {
  std::vector<double> out;
  for (int i = 0; i <= 8 * steps; ++i) {
    const double phase = std::fmod(static_cast<double>(i) / steps, 4);
    out.push_back(scale * (phase < 1 ? phase : phase < 3 ? 2 - phase : phase - 4));
  }
  return out;
}

void put(recordings::Series& to, std::size_t i, double x, double y) {
  if (i >= 4 * static_cast<std::size_t>(steps)) to.points.push_back({x, y});
}

recordings::Series along(MaterialTerm<double>& term, const std::vector<double>& fields, double slow,
                         MaterialState<double> at, const std::string& label, double scale) {
  recordings::Series out{.label = label, .points = {}};
  term.start(at);
  for (std::size_t i = 0; i < fields.size(); ++i) {
    at.time += slow;
    at.field = fields[i];
    put(out, i, picture_axis(recordings::Channel::field).scale * at.field, scale * term.propose(slow, at));
    term.accept(slow, at);
  }
  return out;
}

recordings::Series along(DriveStage<double>& stage, const std::vector<double>& fields, double scale) {
  recordings::Series out{.label = "added to the field", .points = {}};
  stage.start(0);
  double from = 0;
  for (std::size_t i = 0; i < fields.size(); ++i) {
    std::vector<FieldPiece> pieces;
    stage.transform({1, from, fields[i]}, pieces);
    put(out, i, scale * fields[i], scale * (pieces.back().to - fields[i]));
    from = fields[i];
  }
  return out;
}

recordings::Series along(SpringTerm<double>& term, const std::vector<double>& extensions, double scale) {
  recordings::Series out{.label = "added to the extension", .points = {}};
  term.start();
  for (std::size_t i = 0; i < extensions.size(); ++i) {
    put(out, i, scale * extensions[i], scale * term.propose(extensions[i]));
    term.accept(extensions[i]);
  }
  return out;
}

struct State {
  const char* label;
  double plus, minus;
};
constexpr std::array states{State{"poled towards +", 1, 0}, State{"poled towards -", 0, 1},
                            State{"all at 90 degrees", 0, 0}};

}  // namespace

recordings::Figure picture_of_empirical(const EffectSetting& setting) {
  const auto& effect = find_effect(setting.id);
  std::vector<double> values;
  double input_scale = 1, time_constant = 1;
  for (const auto& p : effect.parameters) {
    const auto given = std::ranges::find(setting.parameters, p.name, [](const auto& v) { return v.first; });
    values.push_back(given == setting.parameters.end() ? 0 : given->second);
    if (p.name.ends_with("_scale")) input_scale = values.back();
    if (p.name == "time_constant") time_constant = values.back();
  }
  Model unused;
  Ports ports;
  effect.install(values, unused, ports);
  const auto inputs = cycle(input_scale);
  const auto field_axis = picture_axis(recordings::Channel::field);
  recordings::Figure out{.title = "What " + setting.id + " adds along a slow cycle of the field",
                         .x_label = "field [kV/mm]",
                         .y_label = "added field [kV/mm]",
                         .log_x = false,
                         .square = true,
                         .series = {}};
  double scale = field_axis.scale;
  auto* terms = &ports.seen_by_rates;
  if (!ports.strain.empty()) {
    terms = &ports.strain;
    out.y_label = "added strain [1e-6]";
    scale = 1e6;
  } else if (!ports.polarization.empty()) {
    terms = &ports.polarization;
    out.y_label = "added polarization [C/m²]";
    scale = 1;
  }
  if (!ports.spring.empty()) {
    const auto axis = picture_axis(recordings::Channel::displacement);
    out.title =
        "What " + setting.id + " adds to the extension that its spring answers to, along a slow cycle";
    out.x_label = axis.label;
    out.y_label = "added extension [µm]";
    for (const auto& term : ports.spring) out.series.push_back(along(*term, inputs, axis.scale));
    return out;
  }
  constexpr double many_time_constants = 1e3;
  for (const auto& term : *terms)
    for (const auto& s : states)
      out.series.push_back(along(*term, inputs, many_time_constants * time_constant,
                                 {.plus = s.plus, .minus = s.minus}, s.label, scale));
  for (const auto& stage : ports.drive) out.series.push_back(along(*stage, inputs, scale));
  return out;
}

}  // namespace ferrobench::model
