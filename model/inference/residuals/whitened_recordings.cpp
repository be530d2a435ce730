#include "model/inference/residuals/whitened_recordings.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/inference/common/parallel.h"
#include "model/inference/dataset/recording_data.h"
#include "model/inference/observation/tones.h"
#include "model/past.h"

namespace ferrobench::model::inference {
namespace {

constexpr double believed_offset = 0.03;  // of the range
// Standard deviations of an estimated past's level, as a share of the largest field, and of the logarithm of
// its time: nothing else says what they were. Differences for their slopes: so long that the grain of few
// domains does not show.
constexpr double believed_level = 0.1, believed_pace = 2, level_step = 5e-3, pace_step = 0.1;
// An effect that makes the model stiffer than this is not the one that is looked for.
constexpr std::uint64_t dearer_at_most = 12, few_steps = 5000;

}  // namespace

double WhitenedRecordings::gain_of(const Setting& setting, recordings::Channel channel) {
  const auto k = std::ranges::find(compared_channels, channel) - compared_channels.begin();
  return setting.gain.at(static_cast<std::size_t>(k));
}

WhitenedRecordings::WhitenedRecordings(const std::vector<BenchRecording>& bench,
                                       const std::vector<std::vector<NoiseModel>>& noise,
                                       std::vector<std::size_t> chosen, SimulationOptions simulation,
                                       int threads)
    : WhitenedResiduals(simulation, threads),
      bench_(bench),
      noise_(noise),
      chosen_(std::move(chosen)),
      reference_steps_(bench.size()) {
  for (const std::size_t r : chosen_) {
    const std::size_t first = blocks_.size();
    for (std::size_t c = 0; c < bench_[r].channels.size(); ++c) {
      const auto& m = bench_[r].channels[c];
      Block block{.recording = r, .channel = c, .begin = size_, .count = 0, .rows = {}};
      std::vector<double> times;
      for (std::size_t i = 0; i < m.value.size(); ++i) {
        if (std::isnan(m.value[i])) continue;
        block.rows.push_back(i);
        times.push_back(bench_[r].time[i]);
      }
      block.count = static_cast<Eigen::Index>(block.rows.size());
      size_ += block.count;
      samples_ += static_cast<double>(block.count) / noise_[r][c].rows_as_one;
      Prepared p{.whitening = Whitening(noise_[r][c], times),
                 .constant = Eigen::VectorXd::Ones(block.count),
                 .share = 0};
      p.whitening.apply({p.constant.data(), block.rows.size()});
      // The marginal likelihood over the offset: its precision is this share less along `constant`.
      const double s = p.constant.squaredNorm();
      const double prior = offset_is_free(bench_[r], m) ? 0 : 1 / std::pow(believed_offset * m.range, 2);
      p.share = (1 - std::sqrt(prior / (s + prior))) / s;
      prepared_.push_back(std::move(p));
      blocks_.push_back(std::move(block));
    }
    blocks_of_.emplace_back(first, blocks_.size());
  }
}

std::vector<std::size_t> WhitenedRecordings::parts() const {
  std::vector<std::pair<std::uint64_t, std::size_t>> by_steps;
  for (std::size_t position = 0; position < chosen_.size(); ++position)
    by_steps.emplace_back(reference_steps_[chosen_[position]], position);
  std::ranges::sort(by_steps, std::greater<>());
  std::vector<std::size_t> out;
  out.reserve(by_steps.size());
  for (const auto& [steps, position] : by_steps) out.push_back(position);
  return out;
}

WhitenedResiduals::Times WhitenedRecordings::times() const {
  Times out{.shortest = std::numeric_limits<double>::infinity(), .longest = 0};
  for (const std::size_t r : chosen_) {
    const auto& b = bench_[r];
    out.longest = std::max(out.longest, b.duration());
    out.shortest = std::min(out.shortest, b.duration() / static_cast<double>(b.time.size()));
  }
  return out;
}

std::vector<double> WhitenedRecordings::tones(const Eigen::VectorXd& residual, const EffectParameter& range,
                                              std::size_t count) const {
  std::vector<ToneSeries> series;
  for (const auto& block : blocks_) {
    const auto& r = bench_[block.recording];
    if (r.channels[block.channel].channel != recordings::Channel::displacement) continue;
    auto& s = series.emplace_back();
    s.duration = r.duration();
    for (const std::size_t row : block.rows) s.time.push_back(r.time[row]);
    s.value = residual.segment(block.begin, block.count);
  }
  return strongest_tones(series, {range.low, range.high}, count, threads(), simulation());
}

std::vector<double> WhitenedRecordings::limits(const EffectParameter& parameter) const {
  double highest = 0;
  for (const std::size_t r : chosen_) {
    const auto& b = bench_[r];
    if (parameter.limit_of == LimitOf::displacement) {
      if (const auto* m = b.find(recordings::Channel::displacement))
        for (const double v : m->value)
          if (std::abs(v) > highest) highest = std::abs(v);
    } else if (parameter.limit_of == LimitOf::field_rate) {
      for (std::size_t k = 1; k < b.knot_time.size(); ++k)
        if (const double time = b.knot_time[k] - b.knot_time[k - 1]; time > 0)
          highest = std::max(highest, std::abs(b.knot_field[k] - b.knot_field[k - 1]) / time);
    }
  }
  std::vector<double> out;
  if (highest > 0)
    for (const double share : {0.995, 0.96, 0.9, 0.8, 0.6, 0.3}) out.push_back(share * highest);
  return out;
}

std::vector<std::vector<std::vector<double>>> WhitenedRecordings::channels(
    std::span<const Setting* const> alike, std::size_t recording) const {
  const auto at = apply_setting(*alike.front(), bench_[recording]);
  std::vector<Model> models;
  models.reserve(alike.size());
  for (const auto* setting : alike) models.push_back(setting->model);
  SimulationStatistics statistics;
  auto out = simulate_bench(models, at, bounded(recording), &statistics);
  if (reference_steps_[recording] == 0)
    reference_steps_[recording] = statistics.tried / pieces(recording) + 1;
  return out;
}

std::uint64_t WhitenedRecordings::pieces(std::size_t recording) const {
  const auto& r = bench_[recording];
  return pieces_played(&r.header.past, r.knot_time.size());
}

SimulationOptions WhitenedRecordings::bounded(std::size_t recording) const {
  auto options = simulation();
  if (const std::uint64_t reference = reference_steps_[recording]; reference > 0)
    options.most_steps = few_steps + dearer_at_most * reference * pieces(recording);
  return options;
}

void WhitenedRecordings::finish(std::size_t block, Eigen::Ref<Eigen::VectorXd> part) const {
  const auto& p = prepared_[block];
  p.whitening.apply({part.data(), static_cast<std::size_t>(part.size())});
  part -= p.share * p.constant.dot(part) * p.constant;
}

void WhitenedRecordings::fill(std::span<const Wanted> alike, std::size_t position) const {
  const auto [first, last] = blocks_of_[position];
  std::vector<const Setting*> settings;
  settings.reserve(alike.size());
  for (const auto& wanted : alike) settings.push_back(&wanted.setting);
  std::vector<std::vector<std::vector<double>>> simulated;
  try {
    simulated = channels(settings, chosen_[position]);
  } catch (const Error& e) {
    if (e.code() == ErrorCode::cancelled) throw;
    for (const auto& wanted : alike)
      for (std::size_t b = first; b < last; ++b)
        wanted.residual->segment(blocks_[b].begin, blocks_[b].count).setConstant(unsolvable);
    return;
  }
  for (std::size_t w = 0; w < alike.size(); ++w) {
    const auto& wanted = alike[w];
    for (std::size_t b = first; b < last; ++b) {
      const auto& block = blocks_[b];
      const auto& values = simulated[w][block.channel];
      const auto& measured = bench_[block.recording].channels[block.channel];
      const double gain = gain_of(wanted.setting, measured.channel);
      auto part = wanted.residual->segment(block.begin, block.count);
      for (std::size_t i = 0; i < block.rows.size(); ++i) {
        const double miss = measured.value[block.rows[i]] - gain * values[block.rows[i]];
        part[static_cast<Eigen::Index>(i)] = std::isfinite(miss) ? miss : 0;
      }
      finish(b, part);
    }
    if (!drive_marginals_.empty()) marginalize(drive_marginals_[position], *wanted.residual);
  }
}

void WhitenedRecordings::marginalize(const DriveMarginal& a, Eigen::Ref<Eigen::VectorXd> column) {
  if (a.share.size() == 0) return;
  auto part = column.segment(a.begin, a.count);
  const Eigen::VectorXd along = a.share.asDiagonal() * (a.directions.transpose() * part);
  part -= a.directions * along;
}

// NOLINTNEXTLINE(performance-unnecessary-value-param): written through
void WhitenedRecordings::marginalize(Eigen::Ref<Eigen::VectorXd> column) const {
  for (const auto& a : drive_marginals_) marginalize(a, column);
}

Eigen::VectorXd WhitenedRecordings::miss_of(std::size_t position,
                                            const std::vector<std::vector<double>>& simulated) const {
  const auto& r = bench_[chosen_[position]];
  const auto [first, last] = blocks_of_[position];
  Eigen::VectorXd out(
      first == last ? 0 : blocks_[last - 1].begin + blocks_[last - 1].count - blocks_[first].begin);
  for (std::size_t b = first; b < last; ++b) {
    const auto& block = blocks_[b];
    out.segment(block.begin - blocks_[first].begin, block.count) =
        whiten(block, r.channels[block.channel].value) - whiten(block, simulated[block.channel]);
  }
  return out;
}

double WhitenedRecordings::drive_squares(std::size_t position, const Eigen::VectorXd& normals,
                                         const std::vector<std::vector<double>>& simulated) const {
  return miss_of(position, simulated).squaredNorm() + normals.squaredNorm();
}

Eigen::VectorXd WhitenedRecordings::posterior_drive(const Hypothesis& hypothesis, const Eigen::VectorXd& z,
                                                    std::size_t position, const Eigen::VectorXd& normals,
                                                    const std::vector<std::vector<double>>& simulated) const {
  const auto slopes = drive_jacobian(setting_at(hypothesis, z), position, normals);
  const Eigen::VectorXd miss = slopes * normals + miss_of(position, simulated);
  Eigen::MatrixXd precision = slopes.transpose() * slopes;
  precision.diagonal().array() += 1;
  return precision.llt().solve(slopes.transpose() * miss);
}

// d residual / d (level, logarithm of its time) of a visit, by differences, in what is believed of them.
Eigen::MatrixXd WhitenedRecordings::past_jacobian(const Setting& setting, std::size_t position) const {
  auto r = bench_[chosen_[position]];
  const auto given = r.header.past;
  const auto miss = [&] {
    auto simulated = simulate_bench(setting.model, apply_setting(setting, r), bounded(chosen_[position]));
    for (std::size_t c = 0; c < simulated.size(); ++c)
      for (double& v : simulated[c]) v *= gain_of(setting, r.channels[c].channel);
    return miss_of(position, simulated);
  };
  const auto level = [&]() -> auto& {
    return r.header.past.levels.back();
  };
  const auto stood = miss();
  Eigen::MatrixXd out(stood.size(), 2);
  const double reach = largest_field(r.knot_field);
  level().field += std::copysign(level_step * reach, level().field);
  out.col(0) = (miss() - stood) * (believed_level / level_step);
  r.header.past = given;
  level().seconds *= 1 + pace_step;
  out.col(1) = (miss() - stood) * (believed_pace / std::log1p(pace_step));
  return out;
}

void WhitenedRecordings::marginalize_drive(const Hypothesis& hypothesis, const Eigen::VectorXd& at) {
  drive_marginals_.clear();
  if (std::ranges::none_of(
          chosen_, [&](std::size_t r) { return !bench_[r].level_of.empty() || bench_[r].past_is_free; }))
    return;
  const auto setting = setting_at(hypothesis, at);
  std::vector<DriveMarginal> found(chosen_.size());
  in_parallel(chosen_.size(), threads(), [&](std::size_t position) {
    const auto& r = bench_[chosen_[position]];
    const std::size_t first = blocks_of_[position].first, last = blocks_of_[position].second;
    auto& a = found[position];
    if ((r.level_of.empty() && !r.past_is_free) || first == last) return;
    a.begin = blocks_[first].begin;
    a.count = blocks_[last - 1].begin + blocks_[last - 1].count - a.begin;
    Eigen::MatrixXd columns(a.count, 0);
    if (!r.level_of.empty())
      columns = drive_jacobian(setting, position, Eigen::VectorXd::Zero(r.knot_error.cols()));
    if (r.past_is_free) {
      columns.conservativeResize(Eigen::NoChange, columns.cols() + 2);
      columns.rightCols(2) = past_jacobian(setting, position);
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(columns.transpose() * columns);
    std::vector<Eigen::Index> used;
    for (Eigen::Index k = 0; k < columns.cols(); ++k)
      if (eigen.eigenvalues()[k] > 1e-4) used.push_back(k);
    a.directions.resize(a.count, static_cast<Eigen::Index>(used.size()));
    a.share.resize(static_cast<Eigen::Index>(used.size()));
    for (std::size_t i = 0; i < used.size(); ++i) {
      const double square = eigen.eigenvalues()[used[i]];
      a.directions.col(static_cast<Eigen::Index>(i)) =
          columns * eigen.eigenvectors().col(used[i]) / std::sqrt(square);
      a.share[static_cast<Eigen::Index>(i)] = 1 - 1 / std::sqrt(1 + square);
    }
  });
  drive_marginals_ = std::move(found);
}

std::vector<Eigen::Index> WhitenedRecordings::groups() const {
  std::vector<Eigen::Index> out;
  for (const auto& block : blocks_) out.push_back(block.begin);
  return out;
}

Eigen::VectorXd WhitenedRecordings::whiten(const Block& block, const std::vector<double>& signal) const {
  Eigen::VectorXd part(block.count);
  for (std::size_t i = 0; i < block.rows.size(); ++i)
    part[static_cast<Eigen::Index>(i)] = signal[block.rows[i]];
  finish(static_cast<std::size_t>(&block - blocks_.data()), part);
  return part;
}

std::vector<std::vector<double>> WhitenedRecordings::simulated(const Hypothesis& hypothesis,
                                                               const Eigen::VectorXd& z,
                                                               std::size_t recording,
                                                               const BenchRecording* drive) const {
  const auto setting = setting_at(hypothesis, z);
  const Setting* const alone = &setting;
  auto out = drive == nullptr ? channels({&alone, 1}, recording).front()
                              : simulate_bench(setting.model, apply_setting(setting, *drive), simulation());
  for (std::size_t c = 0; c < out.size(); ++c) {
    const auto& m = bench_[recording].channels[c];
    for (double& v : out[c]) v *= gain_of(setting, m.channel);
    double sum = 0, n = 0;
    for (std::size_t i = 0; i < out[c].size(); ++i) {
      if (std::isnan(m.value[i])) continue;
      sum += m.value[i] - out[c][i];
      ++n;
    }
    double offset = n > 0 ? sum / n : 0;
    if (!offset_is_free(bench_[recording], m)) {
      // Shrunk as the prior on offsets has it.
      const double prior = std::pow(believed_offset * m.range, 2),
                   own = std::pow(noise_[recording][c].std(), 2);
      offset *= prior / (prior + own / std::max(1.0, n));
    }
    for (double& v : out[c]) v += offset;
  }
  return out;
}

std::vector<double> WhitenedRecordings::plain_residual(std::size_t recording, std::size_t channel,
                                                       const std::vector<double>& simulated) const {
  const auto& measured = bench_[recording].channels[channel].value;
  const double std = noise_[recording][channel].std();
  std::vector<double> out(measured.size());
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = (measured[i] - simulated[i]) / std;
  return out;
}

}  // namespace ferrobench::model::inference
