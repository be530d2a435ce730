#include "model/inference/study/validation.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "model/inference/common/parallel.h"

namespace ferrobench::model::inference {
namespace {

constexpr std::size_t fewest_rows = 15;  // in a class of segment, for a figure of it
constexpr int rounds = 6;                // of relinearization at most
constexpr int most_halvings = 4;         // of a step that does worse; then the drive stays where it is
constexpr double settled = 1;            // a round that gains less of the sum of squares was the last one

struct Squares {
  double sum = 0;
  std::size_t count = 0;
  void add(double e) {
    if (std::isnan(e)) return;
    sum += e * e;
    ++count;
  }
  double mean() const { return sum / static_cast<double>(count); }
};

Squares squares_of(std::span<const double> channel) {
  Squares out;
  for (const double e : channel) out.add(e);
  return out;
}

using Channels = std::vector<std::vector<double>>;

// a + factor b.
Channels sum(Channels a, double factor, const Channels& b) {
  for (std::size_t c = 0; c < a.size(); ++c)
    for (std::size_t i = 0; i < a[c].size(); ++i) a[c][i] += factor * b[c][i];
  return a;
}

// The channels under the drive that they want themselves, where the fine simulation gives `exact` under the
// drive as read. Gauss-Newton, by the coarse simulation corrected to that: a step that does worse is halved.
Channels under_posterior_drive(const WhitenedRecordings& fine, const WhitenedRecordings& coarse,
                               const Hypothesis& hypothesis, const Eigen::VectorXd& z, std::size_t position,
                               const Channels& exact) {
  const std::size_t recording = fine.chosen()[position];
  const auto& r = fine.bench()[recording];
  const auto moved = [&](const Eigen::VectorXd& normals) {
    return r.with_knots_moved(r.knot_error * normals);
  };
  const auto correction = sum(exact, -1, coarse.simulated(hypothesis, z, recording));
  Channels simulated = exact;
  Eigen::VectorXd normals = Eigen::VectorXd::Zero(r.knot_error.cols());
  double squares = coarse.drive_squares(position, normals, simulated);
  for (int round = 0; round < rounds; ++round) {
    const Eigen::VectorXd step =
        coarse.posterior_drive(hypothesis, z, position, normals, simulated) - normals;
    const double before = squares;
    for (int halved = 0; halved <= most_halvings && squares == before; ++halved) {
      const Eigen::VectorXd there = normals + std::ldexp(1.0, -halved) * step;
      const auto drive = moved(there);
      auto tried = sum(coarse.simulated(hypothesis, z, recording, &drive), 1, correction);
      const double left = coarse.drive_squares(position, there, tried);
      if (!(left < squares)) continue;
      squares = left;
      normals = there;
      simulated = std::move(tried);
    }
    if (before - squares < settled) break;
  }
  if (normals.isZero(0)) return exact;
  const auto drive = moved(normals);
  return fine.simulated(hypothesis, z, recording, &drive);
}

Prediction predict_by(const WhitenedRecordings& fine, const WhitenedRecordings* coarse,
                      const Hypothesis& hypothesis, const Eigen::VectorXd& z) {
  const auto& chosen = fine.chosen();
  Prediction out{.simulated = Signals(chosen.size()), .standardized = Signals(chosen.size())};
  in_parallel(chosen.size(), fine.threads(), [&](std::size_t i) {
    out.simulated[i] = fine.simulated(hypothesis, z, chosen[i]);
    if (coarse != nullptr && !fine.bench()[chosen[i]].level_of.empty())
      out.simulated[i] = under_posterior_drive(fine, *coarse, hypothesis, z, i, out.simulated[i]);
    for (std::size_t c = 0; c < out.simulated[i].size(); ++c)
      out.standardized[i].push_back(fine.plain_residual(chosen[i], c, out.simulated[i][c]));
  });
  return out;
}

}  // namespace

Prediction predict(const WhitenedRecordings& fine, const WhitenedRecordings& coarse,
                   const Hypothesis& hypothesis, const Eigen::VectorXd& z) {
  return predict_by(fine, &coarse, hypothesis, z);
}

Prediction predict(const WhitenedRecordings& fine, const Hypothesis& hypothesis, const Eigen::VectorXd& z) {
  return predict_by(fine, nullptr, hypothesis, z);
}

ChannelFigures rms_by_channel(const WhitenedRecordings& residuals, const Signals& standardized) {
  std::map<recordings::Channel, Squares> squares;
  for (std::size_t i = 0; i < standardized.size(); ++i)
    for (std::size_t c = 0; c < standardized[i].size(); ++c)
      for (const double e : standardized[i][c])
        squares[residuals.bench()[residuals.chosen()[i]].channels[c].channel].add(e);
  ChannelFigures out;
  for (const auto& [channel, s] : squares)
    if (s.count > 0) out[channel] = std::sqrt(s.mean());
  return out;
}

std::map<recordings::Channel, Left> left_by_channel(const WhitenedRecordings& residuals,
                                                    const Signals& standardized) {
  struct Sums {
    Squares over_noise, of_range;
    double noise = 0;  // sum over the rows of the noise's variance over the range's square
  };
  std::map<recordings::Channel, Sums> sums;
  for (std::size_t i = 0; i < standardized.size(); ++i) {
    const std::size_t r = residuals.chosen()[i];
    for (std::size_t c = 0; c < standardized[i].size(); ++c) {
      const auto& m = residuals.bench()[r].channels[c];
      const double noise = residuals.noise_of(r, c) / m.range;
      auto& to = sums[m.channel];
      for (const double e : standardized[i][c]) {
        to.over_noise.add(e);
        to.of_range.add(e * noise);
        if (!std::isnan(e)) to.noise += noise * noise;
      }
    }
  }
  std::map<recordings::Channel, Left> out;
  for (const auto& [channel, s] : sums) {
    if (s.over_noise.count == 0) continue;
    const auto rows = static_cast<double>(s.of_range.count);
    out[channel] = {.over_noise = std::sqrt(s.over_noise.mean()),
                    .of_range = std::sqrt(s.of_range.mean()),
                    .model_error = std::sqrt(std::max(0.0, s.of_range.sum - s.noise) / rows)};
  }
  return out;
}

std::map<recordings::Channel, Left> left_at(const WhitenedRecordings& residuals, const Hypothesis& hypothesis,
                                            const Eigen::VectorXd& z) {
  return left_by_channel(residuals, predict(residuals, hypothesis, z).standardized);
}

bool is_gross(const WhitenedRecordings& residuals, const Hypothesis& hypothesis, const Eigen::VectorXd& z) {
  constexpr double over_noise = 10, of_range = 0.02;
  return std::ranges::any_of(left_at(residuals, hypothesis, z), [](const auto& l) {
    return l.second.over_noise > over_noise && l.second.of_range > of_range;
  });
}

bool is_material(const WhitenedRecordings& residuals, const Hypothesis& hypothesis, const Eigen::VectorXd& z,
                 double floor) {
  return std::ranges::any_of(left_at(residuals, hypothesis, z),
                             [&](const auto& l) { return l.second.model_error > floor; });
}

double mean_square(std::span<const double> standardized) {
  const auto squares = squares_of(standardized);
  return squares.count > 0 ? squares.mean() : 0;
}

double excess_squares(std::span<const double> standardized) {
  const auto squares = squares_of(standardized);
  return std::max(0.0, squares.sum - static_cast<double>(squares.count));
}

bool shows(const Signals& standardized, const SelectionOptions& options) {
  return std::ranges::any_of(standardized, [&](const auto& recording) {
    return std::ranges::any_of(
        recording, [&](const auto& channel) { return mean_square(channel) > 1 + options.lack_of_fit; });
  });
}

double excess_squares(const Signals& standardized) {
  double out = 0;
  for (const auto& recording : standardized)
    for (const auto& channel : recording) out += excess_squares(channel);
  return out;
}

double share_explained(const Signals& before, const Signals& after) {
  const double was = excess_squares(before), is = excess_squares(after);
  return was > 0 ? std::clamp(1 - is / was, 0.0, 1.0) : 0;
}

std::set<std::size_t> unexplained(const WhitenedRecordings& residuals, const Signals& standardized,
                                  const SelectionOptions& options) {
  std::set<std::size_t> out;
  for (std::size_t i = 0; i < standardized.size(); ++i)
    if (shows({standardized[i]}, options)) out.insert(residuals.chosen()[i]);
  return out;
}

std::vector<Excess> excess_by_segment_class(const WhitenedRecordings& residuals,
                                            const Signals& standardized) {
  std::vector<Excess> out;
  for (std::size_t i = 0; i < standardized.size(); ++i) {
    const auto& r = residuals.bench()[residuals.chosen()[i]];
    for (std::size_t c = 0; c < standardized[i].size(); ++c) {
      std::array<Squares, segment_class_count> squares{};
      for (std::size_t row = 0; row < r.time.size(); ++row)
        squares.at(static_cast<std::size_t>(r.segment_class[row])).add(standardized[i][c][row]);
      for (std::size_t s = 0; s < segment_class_count; ++s)
        if (squares.at(s).count >= fewest_rows)
          out.push_back({r.name, r.channels[c].channel,
                         std::string(segment_class_name(static_cast<SegmentClass>(s))),
                         std::sqrt(squares.at(s).mean())});
    }
  }
  std::ranges::stable_sort(out, std::greater<>(), &Excess::excess);
  return out;
}

std::optional<Remainder> remainder_of(const std::map<recordings::Channel, Left>& left,
                                      const std::vector<Excess>& where, double floor) {
  const auto worst = std::ranges::max_element(left, {}, [](const auto& l) { return l.second.model_error; });
  if (worst == left.end() || worst->second.model_error <= floor) return std::nullopt;
  const auto place = std::ranges::find(where, worst->first, &Excess::channel);
  return Remainder{.channel = worst->first,
                   .segment = place == where.end() ? "" : place->segment,
                   .of_range = worst->second.model_error};
}

std::vector<Trace> traces(const WhitenedRecordings& residuals, const Prediction& before,
                          const Prediction& after, std::size_t count, bool held_out) {
  struct Place {
    std::size_t position = 0, channel = 0;
    double gained = 0, left = 0;
  };
  std::vector<Place> places;
  for (std::size_t i = 0; i < before.standardized.size(); ++i)
    for (std::size_t c = 0; c < before.standardized[i].size(); ++c) {
      const auto &a = before.standardized[i][c], &b = after.standardized[i][c];
      Place place{.position = i, .channel = c};
      for (std::size_t row = 0; row < a.size(); ++row)
        if (!std::isnan(a[row])) {
          place.gained += a[row] * a[row] - b[row] * b[row];
          place.left += b[row] * b[row];
        }
      places.push_back(place);
    }
  // Where nothing was added nothing is gained anywhere.
  std::ranges::stable_sort(places, std::greater<>(),
                           [](const Place& p) { return std::pair(p.gained, p.left); });
  std::vector<Trace> out;
  for (const auto& p : places) {
    if (out.size() == count) break;
    const auto& r = residuals.bench()[residuals.chosen()[p.position]];
    const auto& a = before.standardized[p.position][p.channel];
    // The window of a sixth of the recording in which the base model misses most.
    const std::size_t n = r.time.size(), width = std::max<std::size_t>(std::min<std::size_t>(n, 60), n / 6);
    double sum = 0, most = -1;
    std::size_t begin = 0;
    for (std::size_t row = 0; row < n; ++row) {
      sum += std::isnan(a[row]) ? 0 : a[row] * a[row];
      if (row >= width) sum -= std::isnan(a[row - width]) ? 0 : a[row - width] * a[row - width];
      if (row + 1 >= width && sum > most) {
        most = sum;
        begin = row + 1 - width;
      }
    }
    Trace t{.recording = r.name,
            .channel = r.channels[p.channel].channel,
            .segment = std::string(segment_class_name(r.segment_class[begin + width / 2])),
            .held_out = held_out,
            .time = {},
            .measured = {},
            .before = {},
            .after = {}};
    for (std::size_t row = begin; row < begin + width; ++row) {
      t.time.push_back(r.time[row]);
      t.measured.push_back(r.channels[p.channel].value[row]);
      t.before.push_back(before.simulated[p.position][p.channel][row]);
      t.after.push_back(after.simulated[p.position][p.channel][row]);
    }
    out.push_back(std::move(t));
  }
  return out;
}

}  // namespace ferrobench::model::inference
