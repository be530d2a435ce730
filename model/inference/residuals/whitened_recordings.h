// Whitened residuals on recordings. The offset of each recording's channels is marginalized, with a prior of
// 3 % of the channel's range, and so is what is uncertain of a drive that was read from a measured field.
#pragma once

#include <atomic>
#include <vector>

#include "model/inference/observation/noise.h"
#include "model/inference/residuals/whitened_residuals.h"

namespace ferrobench::model::inference {

struct Block {
  std::size_t recording = 0, channel = 0;  // indices in the bench
  Eigen::Index begin = 0, count = 0;       // rows of the residual
  std::vector<std::size_t> rows;           // of the recording that were measured
};

class WhitenedRecordings final : public WhitenedResiduals {
 public:
  // Of the recordings chosen. `bench` must outlive it.
  WhitenedRecordings(const std::vector<BenchRecording>& bench,
                     const std::vector<std::vector<NoiseModel>>& noise, std::vector<std::size_t> chosen,
                     SimulationOptions simulation, int threads);

  const std::vector<Block>& blocks() const { return blocks_; }
  std::vector<Eigen::Index> groups() const override;  // a channel of a recording each
  const std::vector<BenchRecording>& bench() const { return bench_; }
  const std::vector<std::size_t>& chosen() const { return chosen_; }

  std::optional<Eigen::MatrixXd> slopes(const Hypothesis& hypothesis, const Eigen::VectorXd& z,
                                        Eigen::Index first = 0) const override;
  Times times() const override;
  std::vector<double> tones(const Eigen::VectorXd& residual, const EffectParameter& range,
                            std::size_t count) const override;
  std::vector<double> limits(const EffectParameter& parameter) const override;

  // Drives that were read from a measured field are uncertain, and what that does to the residuals is no
  // fault of the model: the residuals become those of the marginal likelihood over the drives' knots, linear
  // around `at`.
  void marginalize_drive(const Hypothesis& hypothesis, const Eigen::VectorXd& at);
  void marginalize_as(const WhitenedRecordings& other) { drive_marginals_ = other.drive_marginals_; }
  // That on a column that was put together from whiten().
  void marginalize(Eigen::Ref<Eigen::VectorXd> column) const;

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
  Eigen::VectorXd posterior_drive(const Hypothesis& hypothesis, const Eigen::VectorXd& z,
                                  std::size_t position,  // in chosen()
                                  const Eigen::VectorXd& normals,
                                  const std::vector<std::vector<double>>& simulated) const;
  // What that posterior's mean minimizes: squares of the whitened residuals, and of the normals.
  double drive_squares(std::size_t position, const Eigen::VectorXd& normals,
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
  // Of settings that differ in gains and sensors only, without gains.
  std::vector<std::vector<std::vector<double>>> channels(std::span<const Setting* const> alike,
                                                         std::size_t recording) const;
  // The same with slopes (dataset/bench.h). Empty if it cannot be solved. `at` is the recording as the
  // setting has it.
  std::optional<BenchSlopes> channels_with_slopes(const Setting& setting, std::size_t recording,
                                                  const BenchRecording& at,
                                                  std::span<const std::string> numbers,
                                                  const DriveDirections& directions) const;
  // Of the field that a simulation of the recording plays, its past included.
  std::uint64_t pieces(std::size_t recording) const;
  // What a simulation of the recording may cost.
  SimulationOptions bounded(std::size_t recording) const;
  static double gain_of(const Setting& setting, recordings::Channel channel);
  // A recording's part of measured less simulated, whitened.
  Eigen::VectorXd miss_of(std::size_t position, const std::vector<std::vector<double>>& simulated) const;
  // Changes of a recording's part of the simulated signals, whitened, by the columns of knot_error.
  Eigen::MatrixXd drive_jacobian(const Setting& setting, std::size_t position,
                                 const Eigen::VectorXd& normals) const;

  const std::vector<BenchRecording>& bench_;
  const std::vector<std::vector<NoiseModel>>& noise_;
  std::vector<std::size_t> chosen_;
  std::vector<Block> blocks_;
  // r - directions * diag(share) * directions^T r, on the rows of one recording.
  struct DriveMarginal {
    Eigen::Index begin = 0, count = 0;
    Eigen::MatrixXd directions;
    Eigen::VectorXd share;
  };
  Eigen::MatrixXd past_jacobian(const Setting& setting, std::size_t position) const;
  static void marginalize(const DriveMarginal& a, Eigen::Ref<Eigen::VectorXd> column);
  std::vector<DriveMarginal> drive_marginals_;  // by position in chosen_, or none
  std::vector<Prepared> prepared_;
  std::vector<std::pair<std::size_t, std::size_t>> blocks_of_;  // by position in chosen_: first, past last
  // By recording of the bench: steps a piece that its first simulation took, which bounds all others.
  mutable std::vector<std::atomic<std::uint64_t>> reference_steps_;
};

}  // namespace ferrobench::model::inference
