#include "model/gradient_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "model/forward_sensitivities.h"
#include "model/model_fields.h"

namespace ferrobench::model {
namespace {

constexpr std::array<std::string_view, 4> channels{"field", "charge", "displacement", "force"};

using Columns = std::array<std::vector<double>, 4>;

Columns columns(std::size_t size) {
  Columns out;
  for (auto& column : out) column.resize(size);
  return out;
}

class PlanRecorder final : public StepObserver {
 public:
  PlanRecorder(Simulator::State& state, StepPlan& plan) : state_(state), plan_(plan) {
    plan_.lattice = state.lattice;
    if (state.ensemble != nullptr) state.ensemble->record();
  }
  void start(double, const Fractions&, double) override { plan_.start = change(); }
  void begin_recording() override { plan_.cycles = state_.cycles; }
  void play(const FieldPiece&, std::size_t) override {}
  void solved(const SolvedStep& step) override { plan_.steps.push_back({step.share, step.last, change()}); }
  void sense_at(double, std::size_t) override {}
  void sense_within(double) override {}
  void accepted() override { plan_.steps.back().change.slept = change().slept; }

 private:
  InactiveSetChange change() {
    return state_.ensemble == nullptr ? InactiveSetChange{} : state_.ensemble->take_change();
  }
  Simulator::State& state_;
  StepPlan& plan_;
};

struct Program {
  std::span<const double> knot_time, knot_field, times;
};

StepPlan plan_of(const Model& model, const Program& p, const SimulationOptions& options) {
  StepPlan plan;
  Simulator::State state(model, options);
  PlanRecorder recorder(state, plan);
  state.observer = &recorder;
  play_knots(state, p.knot_time, p.knot_field, p.times, {});
  return plan;
}

Columns follow(const Model& model, const StepPlan& plan, const Program& p, const SimulationOptions& options) {
  auto out = columns(p.times.size());
  Simulator::State state(model, options, &plan);
  ChannelSpans spans;
  spans.field = out[0];
  spans.charge = out[1];
  spans.displacement = out[2];
  spans.force = out[3];
  play_knots(state, p.knot_time, p.knot_field, p.times, spans);
  return out;
}

Columns slopes_along(const Model& model, const StepPlan& plan, const Program& p,
                     const SimulationOptions& options, std::span<const std::string> paths) {
  auto out = columns(p.times.size() * paths.size());
  Simulator::State state(model, options, &plan);
  ForwardSensitivities sensitivities(
      state, model, paths, {.field = out[0], .charge = out[1], .displacement = out[2], .force = out[3]});
  state.observer = &sensitivities;
  play_knots(state, p.knot_time, p.knot_field, p.times, {},
             [&](std::size_t done) { sensitivities.begin(done); });
  return out;
}

double value_at(Model model, const std::string& path) {
  double out = 0;
  for_each_number(model, [&](const std::string& name, double& number) {
    if (name == path) out = number;
  });
  return out;
}

Model moved(Model model, const std::string& path, double by) {
  for_each_number(model, [&](const std::string& name, double& number) {
    if (name == path) number += by;
  });
  return model;
}

double rms(const std::vector<double>& v) {
  double sum = 0;
  for (const double x : v) sum += x * x;
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, v.size())));
}

// Slopes by parameter j of `count` against the differences of runs at 2 d, d, -d, -2 d.
void compare(const std::vector<double>& slopes, std::size_t j, std::size_t count,
             const std::array<Columns, 4>& runs, std::size_t channel, double d, SlopeCheck& out) {
  const std::size_t times = runs[0][channel].size();
  std::vector<double> slope(times), error(times);
  for (std::size_t i = 0; i < times; ++i) {
    const auto at = [&](std::size_t run) { return runs[run][channel][i]; };
    slope[i] = slopes[i * count + j];
    error[i] = (8 * (at(1) - at(2)) - (at(0) - at(3))) / (12 * d) - slope[i];
    out.largest = std::max(out.largest, std::abs(slope[i]));
  }
  const double size = rms(slope), off = rms(error);
  out.error = std::min(out.error, off == 0 ? 0 : off / std::max(size, 1e-300));
}

}  // namespace

std::vector<SlopeCheck> check_gradient(const Model& model, std::span<const CheckedParameter> parameters,
                                       std::span<const double> knot_time, std::span<const double> knot_field,
                                       std::span<const double> times, const GradientCheckOptions& options) {
  const Program program{knot_time, knot_field, times};
  const auto plan = plan_of(model, program, options.simulation);
  const auto at = follow(model, plan, program, options.simulation);
  std::vector<std::string> paths;
  for (const auto& p : parameters) paths.push_back(p.path);
  const auto slopes = slopes_along(model, plan, program, options.simulation, paths);

  std::vector<SlopeCheck> out;
  for (std::size_t j = 0; j < paths.size(); ++j) {
    const double scale = parameters[j].scale != 0 ? parameters[j].scale : std::abs(value_at(model, paths[j]));
    std::array<SlopeCheck, 4> found;
    for (std::size_t c = 0; c < channels.size(); ++c)
      found[c] = {paths[j], channels[c], 0, std::numeric_limits<double>::infinity()};
    for (const double share : options.relative_steps) {
      // Layers are whole, and all is linear in their number.
      const double d = paths[j] == "actuator.layer_count" ? 1 : share * scale;
      const auto run = [&](double by) {
        return follow(moved(model, paths[j], by), plan, program, options.simulation);
      };
      std::array<Columns, 4> runs;
      try {
        runs = {run(2 * d), run(d), run(-d), run(-2 * d)};
      } catch (const Error& e) {
        // So far away the plan does not hold: an amplifier's output has other pieces, say.
        if (e.code() != ErrorCode::numerical) throw;
        continue;
      }
      bool agrees = true;
      for (std::size_t c = 0; c < channels.size(); ++c) {
        compare(slopes[c], j, paths.size(), runs, c, d, found[c]);
        agrees = agrees && found[c].error < options.enough;
      }
      if (agrees) break;
    }
    for (std::size_t c = 0; c < channels.size(); ++c) {
      const auto [low, high] = std::minmax_element(at[c].begin(), at[c].end());
      if (*high == *low) continue;
      found[c].largest *= scale / (*high - *low);
      out.push_back(found[c]);
    }
  }
  return out;
}

}  // namespace ferrobench::model
