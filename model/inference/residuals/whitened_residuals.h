// Residuals of a hypothesis in standard deviations of what was measured, independent of each other: whitened.
//
//   r(z) = W (y - y_sim(z)),   W^T W the inverse covariance of the noise
//
// Nuisance parameters that enter linearly with a normal prior (offsets, a drive that is known with an
// uncertainty) are marginalized: with D their whitened directions, scaled by the priors, the covariance
// becomes I + D D^T, and r is multiplied by its inverse square root.
#pragma once

#include <Eigen/Dense>
#include <map>
#include <optional>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "model/effects/catalogue.h"
#include "model/inference/parameters/scaled_parameters.h"
#include "model/simulator.h"

namespace ferrobench::model::inference {

class WhitenedResiduals {
 public:
  virtual ~WhitenedResiduals() = default;

  Eigen::Index size() const { return size_; }
  // Rows that are independent of each other: all of them, unless the model has an error of its own.
  double samples() const { return samples_; }
  // Rows that share whatever is wrong of the model: the first of each group. None: each row stands alone.
  virtual std::vector<Eigen::Index> groups() const { return {}; }
  int threads() const { return threads_; }
  const SimulationOptions& simulation() const { return simulation_; }
  // What may stop it and what counts it stay.
  void simulate_by(const SimulationOptions& simulation);
  // The simulation that the last steps of a fit are made by (solver/multifidelity.h).
  const SimulationOptions& last_steps() const { return last_steps_; }
  void make_last_steps_by(const SimulationOptions& simulation) { last_steps_ = simulation; }
  // `residual` is what the simulation as it stands gives at z. From here on those of fewer nodes are shifted
  // by what they lack of it there: the error of few nodes changes little with z, so it is its own control
  // variate. Until more nodes are asked for, or release(); the noise must not change meanwhile.
  void anchor(const Hypothesis& hypothesis, const Eigen::VectorXd& z, Eigen::VectorXd residual);
  // Without an anchor again, by the simulation that it was made by.
  void release();
  bool is_anchored() const { return anchor_.has_value(); }

  // Measured less simulated. If the model cannot be solved there: rows of 1e6.
  Eigen::VectorXd evaluate(const Hypothesis& hypothesis, const Eigen::VectorXd& z) const;
  // At several places at once, spread over the threads.
  std::vector<Eigen::VectorXd> evaluate(
      const std::vector<std::pair<const Hypothesis*, Eigen::VectorXd>>& places) const;

  // d residual / dz at z by the parameters from `first` on, a column each. Empty if the model cannot be
  // solved there, or its slopes cannot be had.
  virtual std::optional<Eigen::MatrixXd> slopes(const Hypothesis& hypothesis, const Eigen::VectorXd& z,
                                                Eigen::Index first = 0) const = 0;

  // Whether a change of the residuals comes from a model that could not be solved on one side of it.
  static bool is_unsolved(const Eigen::VectorXd& change) {
    return change.cwiseAbs().maxCoeff() > 0.1 * unsolvable;
  }

  // The shortest and the longest time constant that could show.
  struct Times {
    double shortest = 0, longest = 0;  // s
  };
  virtual Times times() const = 0;
  // Frequencies within the range at which a residual's displacement has its strongest tones, phase zero at
  // each start.
  virtual std::vector<double> tones(const Eigen::VectorXd& residual, const EffectParameter& range,
                                    std::size_t count) const = 0;
  // Where a limit would show, from hardly to plainly; none for what is no limit.
  virtual std::vector<double> limits(const EffectParameter& parameter) const = 0;

 protected:
  WhitenedResiduals(SimulationOptions simulation, int threads) : simulation_(simulation), threads_(threads) {}
  // What is simulated one by one, the dearest first.
  virtual std::vector<std::size_t> parts() const = 0;
  struct Wanted {
    Setting setting;
    Eigen::VectorXd* residual = nullptr;
  };
  // `alike`: settings that differ in gains and sensors only, so that one simulation does for all.
  virtual void fill(std::span<const Wanted> alike, std::size_t part) const = 0;
  static constexpr double unsolvable = 1e6;
  Eigen::Index size_ = 0;
  double samples_ = 0;

 private:
  struct Anchor {
    Hypothesis hypothesis;
    Eigen::VectorXd z, residual;
    SimulationOptions simulation;
    // Of the simulations so far, by their nodes, shift and tolerance; zero if one cannot be solved there.
    std::map<std::tuple<int, int, double>, Eigen::VectorXd> differences;
  };
  void find_difference();

  SimulationOptions simulation_, last_steps_ = simulation_;
  std::optional<Anchor> anchor_;
  const Eigen::VectorXd* difference_ = nullptr;  // of the simulation as it stands
  int threads_;
};

}  // namespace ferrobench::model::inference
