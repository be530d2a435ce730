// The noise of a channel, found in the data, and its whitening.
//
// Noise is taken as white plus, where the data show it, an exponentially correlated part (an AR(1) process in
// continuous time). Its level comes from second differences (statistics.h), which signals hardly touch; its
// colour from the autocovariance within the quiet windows of the recording, detrended by a quartic. A tone
// is no noise and is taken out before.
//
// A model that is wrong a little everywhere misses by more than noise, and over many rows in the same
// direction. That error is taken as a second variance, and rows that go together count as one (a power
// likelihood: P. G. Bissiri, C. C. Holmes and S. G. Walker, J. R. Statist. Soc. B 78 (2016) 1103):
//
//   -2 ln L = sum over rows of miss^2 / ((noise^2 + error^2) t),   t the integrated autocorrelation, rows
//
// A stationary process along the program in its place (Ornstein-Uhlenbeck) would weigh how fast the miss
// changes, and a slow error of many percent next to nothing, while what a laboratory wants small is the miss.
#pragma once

#include <span>
#include <vector>

#include "model/inference/dataset/bench.h"

namespace ferrobench::model::inference {

// Share of a channel's range: noise of less is below what any simulation resolves, and counts as that much.
inline constexpr double smallest_noise = 2e-4;

struct NoiseModel {
  double white = 0;             // standard deviation
  double slow = 0;              // standard deviation of the correlated part
  double correlation_time = 0;  // s
  double model_error = 0;       // standard deviation of the model's own error; 0: it has none
  double rows_as_one = 1;       // t, where the model has one
  double std() const;           // of the noise alone
};

// By recording and channel, in the order of the bench.
std::vector<std::vector<NoiseModel>> estimate_noise(const std::vector<BenchRecording>& bench,
                                                    std::vector<std::string>& warnings);

// What two programs that solve the same equations differ by in these recordings, each recalibrated to the
// same data, in the sum of squares: n (d / sigma)^2 over the channels, n measured rows with the noise sigma,
// d 2.5e-5 of the range.
double squares_between_programs(const std::vector<BenchRecording>& bench,
                                const std::vector<std::vector<NoiseModel>>& noise,
                                std::span<const std::size_t> recordings);

// Turns residuals into independent ones of unit variance: the innovations of a Kalman filter of one state.
// Linear, so columns of a Jacobian go the same way as the residuals.
class Whitening {
 public:
  // At these times; rising.
  Whitening(const NoiseModel& noise, std::span<const double> times);
  void apply(std::span<double> values) const;

 private:
  std::vector<double> decay_, gain_, inverse_std_;
};

}  // namespace ferrobench::model::inference
