// Residuals of a hypothesis in standard deviations of what was measured.
//
// On recordings they are whitened, and an offset of each recording's channels is taken out, as far as 3 % of
// the range are believed. On published tables see table_misfit.h.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <span>

#include "model/discrepancy/coordinates.h"
#include "model/discrepancy/noise.h"
#include "model/effects/catalogue.h"

namespace ferrobench::model::discrepancy {

// Calls task(0 .. count-1), spread over threads; the first exception is thrown again. Within a task, another
// one runs on its thread alone.
void in_parallel(std::size_t count, int threads, const std::function<void(std::size_t)>& task);

struct Block {
  std::size_t recording = 0, channel = 0;  // indices in the bench
  Eigen::Index begin = 0, count = 0;       // rows of the residual
  std::vector<std::size_t> rows;           // of the recording that were measured
};

class Misfit {
 public:
  virtual ~Misfit() = default;

  Eigen::Index size() const { return size_; }
  int threads() const { return threads_; }
  int simulations() const { return simulations_; }  // of the whole set
  const SimulationOptions& simulation() const { return simulation_; }
  // What may stop it stays.
  void simulate_by(const SimulationOptions& simulation) {
    const auto* stop = simulation_.stop;
    simulation_ = simulation;
    simulation_.stop = stop;
  }

  // Measured less simulated. If the model cannot be solved there: rows of 1e6.
  Eigen::VectorXd residuals(const Hypothesis& hypothesis, const Eigen::VectorXd& z) const;
  // At several places at once, spread over the threads.
  std::vector<Eigen::VectorXd> residuals(
      const std::vector<std::pair<const Hypothesis*, Eigen::VectorXd>>& places) const;

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
  Misfit(SimulationOptions simulation, int threads) : simulation_(simulation), threads_(threads) {}
  // What is simulated one by one, the dearest first.
  virtual std::vector<std::size_t> parts() const = 0;
  struct Wanted {
    std::size_t place = 0;
    Setting setting;
    Eigen::VectorXd* residual = nullptr;
  };
  // `alike`: settings that differ in gains only, so that one simulation does for all.
  virtual void fill(std::span<const Wanted> alike, std::size_t part) const = 0;
  static constexpr double unsolvable = 1e6;
  Eigen::Index size_ = 0;

 private:
  SimulationOptions simulation_;
  int threads_;
  mutable std::atomic<int> simulations_{0};
};

class RecordingMisfit final : public Misfit {
 public:
  // Of the recordings chosen. `bench` must outlive it.
  RecordingMisfit(const std::vector<BenchRecording>& bench, const std::vector<std::vector<NoiseModel>>& noise,
                  std::vector<std::size_t> chosen, SimulationOptions simulation, int threads);

  const std::vector<Block>& blocks() const { return blocks_; }
  const std::vector<BenchRecording>& bench() const { return bench_; }
  const std::vector<std::size_t>& chosen() const { return chosen_; }

  Times times() const override;
  std::vector<double> tones(const Eigen::VectorXd& residual, const EffectParameter& range,
                            std::size_t count) const override;
  std::vector<double> limits(const EffectParameter& parameter) const override;

  // Drives that were read from a measured field are uncertain, and what that does to the residuals is no
  // misfit: the residuals become those of the marginal likelihood over the drives' knots, linear around
  // `at`.
  void allow_for_drives(const Hypothesis& hypothesis, const Eigen::VectorXd& at);
  void allow_as(const RecordingMisfit& other) { allowances_ = other.allowances_; }
  // That on a column that was put together from whiten().
  void allow(Eigen::Ref<Eigen::VectorXd> column) const;

  // A signal in SI of one block's rows (of the recording's length) as it would enter the residual.
  Eigen::VectorXd whiten(const Block& block, const std::vector<double>& signal) const;
  // What the hypothesis gives for a recording's channels in SI, gains and factors included, offset too;
  // with another drive than the bench has, where one is given.
  std::vector<std::vector<double>> simulated(const Hypothesis& hypothesis, const Eigen::VectorXd& z,
                                             std::size_t recording,
                                             const BenchRecording* drive = nullptr) const;
  // Where the channels want a drive that was read from a measured field, as far as the field's noise allows:
  // the mean of the posterior over the unit normals of its knots, linear around `normals`, where the channels
  // are as `simulated`.
  Eigen::VectorXd settled_drive(const Hypothesis& hypothesis, const Eigen::VectorXd& z,
                                std::size_t position,  // in chosen()
                                const Eigen::VectorXd& normals,
                                const std::vector<std::vector<double>>& simulated) const;
  // Measured less simulated over the noise's standard deviation, not whitened; NaN where not measured.
  std::vector<double> plain_residual(std::size_t recording, std::size_t channel,
                                     const std::vector<double>& simulated) const;
  double noise_of(std::size_t recording, std::size_t channel) const {
    return noise_[recording][channel].std();
  }

 private:
  struct Prepared {
    Whitening whitening;
    Eigen::VectorXd constant;  // whitened offset of 1
    double share = 0;          // of it to take out
  };
  std::vector<std::size_t> parts() const override;
  void fill(std::span<const Wanted> alike, std::size_t position) const override;
  void finish(std::size_t block, Eigen::Ref<Eigen::VectorXd> part) const;
  std::vector<std::vector<double>> channels(const Setting& setting,
                                            std::size_t recording) const;  // without gains
  // Changes of a recording's part of the simulated signals, whitened, by the columns of knot_error.
  Eigen::MatrixXd drive_slopes(const Setting& setting, std::size_t position,
                               const Eigen::VectorXd& normals) const;

  const std::vector<BenchRecording>& bench_;
  const std::vector<std::vector<NoiseModel>>& noise_;
  std::vector<std::size_t> chosen_;
  std::vector<Block> blocks_;
  // r - directions * diag(share) * directions^T r, on the rows of one recording.
  struct Allowance {
    Eigen::Index begin = 0, count = 0;
    Eigen::MatrixXd directions;
    Eigen::VectorXd share;
  };
  static void allow(const Allowance& a, Eigen::Ref<Eigen::VectorXd> column);
  std::vector<Allowance> allowances_;  // by position in chosen_, or none
  std::vector<Prepared> prepared_;
  std::vector<std::pair<std::size_t, std::size_t>> blocks_of_;  // by position in chosen_: first, past last
  // By recording of the bench: steps that its first simulation took, which bounds all others.
  mutable std::vector<std::atomic<std::uint64_t>> usual_steps_;
};

}  // namespace ferrobench::model::discrepancy
