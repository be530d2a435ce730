#include "model/gradient_check.h"

#include <algorithm>
#include <array>
#include <cmath>

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
  void start(double) override { plan_.start = change(); }
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
    // Layers are whole, and all is linear in their number.
    const double d = paths[j] == "actuator.layer_count" ? 1 : options.relative_step * scale;
    const auto run = [&](double by) {
      return follow(moved(model, paths[j], by), plan, program, options.simulation);
    };
    const auto up = run(d), down = run(-d), far_up = run(2 * d), far_down = run(-2 * d);
    for (std::size_t c = 0; c < channels.size(); ++c) {
      const auto [low, high] = std::minmax_element(at[c].begin(), at[c].end());
      std::vector<double> slope(times.size()), error(times.size());
      double largest = 0;
      for (std::size_t i = 0; i < times.size(); ++i) {
        slope[i] = slopes[c][i * paths.size() + j];
        const double difference = (8 * (up[c][i] - down[c][i]) - (far_up[c][i] - far_down[c][i])) / (12 * d);
        error[i] = difference - slope[i];
        largest = std::max({largest, std::abs(slope[i]), std::abs(difference)});
      }
      if (*high == *low && largest == 0) continue;
      const double range = *high > *low ? *high - *low : std::max(std::abs(*high), 1e-300);
      out.push_back(
          {paths[j], channels[c], largest * scale / range, rms(error) / std::max(rms(slope), 1e-300)});
    }
  }
  return out;
}

}  // namespace ferrobench::model
