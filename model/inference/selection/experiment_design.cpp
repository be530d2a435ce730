#include "model/inference/selection/experiment_design.h"

#include <algorithm>
#include <cmath>

#include "protocols/protocol.h"

namespace ferrobench::model::inference {
namespace {

// The program on the bench: the specimen, load and channels of a recording that is there.
std::optional<BenchRecording> planned(const std::string& protocol, const BenchRecording& like, double low,
                                      double high, const SelectionOptions& options) {
  protocols::Waveform w;
  try {
    w = protocols::library_protocol(protocol).expand(
        {.layer_thickness = like.header.specimen.layer_thickness});
  } catch (const Error&) {
    return std::nullopt;  // written for another specimen
  }
  if (w.minimum() < low || w.maximum() > high || w.duration() > options.longest_experiment)
    return std::nullopt;
  BenchRecording out;
  out.name = protocol;
  out.header = like.header;
  out.has_command = true;
  const auto knot = [&](double time) {
    if (!out.knot_time.empty() && time <= out.knot_time.back()) return;
    out.knot_time.push_back(time);
    out.knot_field.push_back(w.value(time));
  };
  knot(0);
  for (const auto& piece : w.pieces()) {
    const int parts = piece.kind == protocols::PieceKind::sine
                          ? 16 * static_cast<int>(std::ceil(piece.duration * piece.frequency))
                          : 1;
    for (int i = 1; i <= std::max(1, parts); ++i) knot(piece.start + piece.duration * i / std::max(1, parts));
  }
  // As many rows in each leg, since legs differ by decades in duration.
  const std::size_t each = std::max<std::size_t>(4, options.experiment_rows / out.knot_time.size());
  for (std::size_t k = 1; k < out.knot_time.size(); ++k)
    for (std::size_t i = 0; i < each; ++i)
      out.time.push_back(out.knot_time[k - 1] + (out.knot_time[k] - out.knot_time[k - 1]) *
                                                    static_cast<double>(i) / static_cast<double>(each));
  out.segment_class.assign(out.time.size(), SegmentClass::rest);
  for (const auto& m : like.channels) {
    auto& channel = out.channels.emplace_back(m);
    channel.value.assign(out.time.size(), 0);
  }
  return out;
}

// Empty where the model cannot be solved under that program: it says nothing then.
std::optional<std::vector<std::vector<double>>> simulated(const WhitenedRecordings& of_plan, const Fit& by) {
  try {
    return of_plan.simulated(by.hypothesis, by.z, 0);
  } catch (const Error& failure) {
    if (failure.code() != ErrorCode::numerical) throw;
    return std::nullopt;
  }
}

}  // namespace

std::optional<NextExperiment> choose_experiment(const WhitenedRecordings& residuals,
                                                const std::vector<std::vector<NoiseModel>>& noise,
                                                const Fit& a, const Fit& b, const SelectionOptions& options) {
  double low = 0, high = 0;
  for (const auto& r : residuals.bench())
    for (const double e : r.knot_field) {
      low = std::min(low, 1.02 * e);
      high = std::max(high, 1.02 * e);
    }
  const std::size_t like = residuals.chosen().front();
  const Eigen::MatrixXd known = b.normal();
  NextExperiment best;
  double most = 0;
  for (const auto& protocol : protocols::library_names()) {
    auto plan = planned(protocol, residuals.bench()[like], low, high, options);
    if (!plan) continue;
    std::vector<BenchRecording> bench{*plan};
    const std::vector<std::vector<NoiseModel>> its_noise{noise[like]};
    const WhitenedRecordings of_plan(bench, its_noise, {0}, residuals.simulation(), residuals.threads());
    // Offsets are marginalized, so it does not matter that the simulated values have one of their own.
    const auto expected = simulated(of_plan, a);
    if (!expected) continue;
    for (std::size_t c = 0; c < bench[0].channels.size(); ++c) {
      auto& m = bench[0].channels[c];
      m.value = (*expected)[c];
      const auto [least, largest] = std::ranges::minmax(m.value);
      m.range = std::max(m.range, largest - least);
    }
    const WhitenedRecordings seen(bench, its_noise, {0}, residuals.simulation(), residuals.threads());
    Fit f{.hypothesis = b.hypothesis,
          .z = b.z,
          .residual = seen.evaluate(b.hypothesis, b.z),
          .fidelity_correction = {},
          .jacobian = {}};
    if (WhitenedResiduals::is_unsolved(f.residual) || !refresh_jacobian(seen, f)) continue;
    const Eigen::VectorXd pull = f.jacobian.transpose() * f.residual;
    const Eigen::MatrixXd information = known + f.jacobian.transpose() * f.jacobian;
    const double evidence = f.residual.squaredNorm() - pull.dot(information.ldlt().solve(pull));
    if (std::isfinite(evidence) && evidence > most) {
      most = evidence;
      best = {protocol, std::exp(std::min(40.0, evidence / (2 * options.likelihood_tempering)))};
    }
  }
  if (best.expected_odds < options.decisive_odds) return std::nullopt;
  return best;
}

}  // namespace ferrobench::model::inference
