#include "model/inference/study/model_error.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "model/inference/solver/covariance.h"
#include "recordings/analysis/statistics.h"

namespace ferrobench::model::inference {
namespace {

// The integrated autocorrelation is what a constant sees. What parameters and terms do changes a few times
// along a loop, where an error so correlated has about a quarter of that power.
constexpr double along_a_loop = 0.25;
constexpr double least_error = 1e-5;  // of the range: the likelihood needs one above zero
// Of a channel's median error over its range: a recording that is met better than that by chance must not
// outweigh the others.
constexpr double least_of_median = 0.5;

// Between what one channel of one recording says of the error and what is usual of the channel.
double pooled(double own, double usual) {
  return std::sqrt(own * usual);
}

}  // namespace

void estimate_model_errors(const std::vector<BenchRecording>& bench, const Signals& standardized,
                           const std::vector<std::size_t>& recordings,
                           std::vector<std::vector<NoiseModel>>& noise) {
  std::map<recordings::Channel, std::vector<double>> of_range;
  for (std::size_t i = 0; i < recordings.size(); ++i)
    for (std::size_t c = 0; c < standardized[i].size(); ++c) {
      auto& n = noise[recordings[i]][c];
      const auto& m = bench[recordings[i]].channels[c];
      std::vector<double> rows;
      for (const double e : standardized[i][c])
        if (!std::isnan(e)) rows.push_back(e);
      const auto count = std::max<double>(1, static_cast<double>(rows.size()));
      n.model_error = n.std() * std::sqrt(excess_squares(rows) / count);
      n.rows_as_one = std::max(1.0, along_a_loop * correlated_rows(Eigen::Map<const Eigen::VectorXd>(
                                                       rows.data(), std::ssize(rows))));
      of_range[m.channel].push_back(n.model_error / m.range);
    }
  for (const std::size_t r : recordings)
    for (std::size_t c = 0; c < noise[r].size(); ++c) {
      const auto& m = bench[r].channels[c];
      const double usual = m.range * ferrobench::recordings::median(of_range.at(m.channel));
      noise[r][c].model_error =
          std::max({pooled(noise[r][c].model_error, usual), least_of_median * usual, least_error * m.range});
    }
}

double excess_beside_error(const std::vector<std::vector<NoiseModel>>& noise, const Signals& standardized,
                           const std::vector<std::size_t>& recordings) {
  double out = 0;
  for (std::size_t i = 0; i < recordings.size(); ++i)
    for (std::size_t c = 0; c < standardized[i].size(); ++c) {
      const auto& n = noise[recordings[i]][c];
      out += excess_squares(standardized[i][c]) / (1 + std::pow(n.model_error / n.std(), 2));
    }
  return out;
}

double log_likelihood_ratio_beside_error(const std::vector<std::vector<NoiseModel>>& noise,
                                         const Signals& before, const Signals& with,
                                         const std::vector<std::size_t>& recordings) {
  double out = 0;
  for (std::size_t i = 0; i < recordings.size(); ++i)
    for (std::size_t c = 0; c < with[i].size(); ++c) {
      double squares_before = 0, squares_with = 0, rows = 0;
      for (std::size_t k = 0; k < with[i][c].size(); ++k) {
        if (std::isnan(with[i][c][k])) continue;
        squares_before += before[i][c][k] * before[i][c][k];
        squares_with += with[i][c][k] * with[i][c][k];
        ++rows;
      }
      if (rows > 0)
        out += rows / noise[recordings[i]][c].rows_as_one * std::log(squares_before / squares_with);
    }
  return out;
}

double log_likelihood_ratio_beside_error(const WhitenedRecordings& residuals,
                                         const std::vector<std::vector<NoiseModel>>& noise, const Fit& before,
                                         const Fit& with) {
  double out = prior_squares(before.hypothesis, before.z) - prior_squares(with.hypothesis, with.z);
  for (const auto& b : residuals.blocks()) {
    if (b.count == 0) continue;
    const double n = static_cast<double>(b.count) / noise[b.recording][b.channel].rows_as_one;
    out += n * std::log(before.residual.segment(b.begin, b.count).squaredNorm() /
                        with.residual.segment(b.begin, b.count).squaredNorm());
  }
  return out;
}

bool is_error_material(const std::vector<BenchRecording>& bench,
                       const std::vector<std::vector<NoiseModel>>& noise,
                       const std::vector<std::size_t>& recordings, double floor) {
  for (const std::size_t r : recordings)
    for (std::size_t c = 0; c < noise[r].size(); ++c)
      if (noise[r][c].model_error > floor * bench[r].channels[c].range) return true;
  return false;
}

}  // namespace ferrobench::model::inference
