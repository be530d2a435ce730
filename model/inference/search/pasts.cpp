#include "model/inference/search/pasts.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "model/inference/dataset/succession.h"
#include "model/inference/residuals/simulated_rows.h"
#include "model/inference/solver/covariance.h"
#include "model/on_recording.h"

namespace ferrobench::model {
namespace {

using protocols::FirstState;
using protocols::Past;
using protocols::PastKind;

// Extreme levels to try, as shares of the recording's own largest field: below a third nothing switches that
// the recording would show, and beyond one and a half nothing is left to switch.
constexpr std::array levels{0.3, 0.45, 0.6, 0.75, 0.9, 1.0, 1.2, 1.5};
// Steps of the golden section between the neighbours of the best: to 2 % of the distance.
constexpr int refinements = 8;
// Level and pace together: steps at most, their lengths and those of the differences (in shares of the
// largest field, and in the logarithm of the time), and the gain that ends them.
constexpr int steps_of_pace = 12;
constexpr double most_of_level = 0.15, most_of_logarithm = 1.5, farthest_level = 2;
constexpr double step_of_level = 1e-3, step_of_logarithm = 0.05;
constexpr double least_gain_of_pace = 2;
constexpr int dampings = 5;
constexpr double least_damping = 1e-3, more_damping = 30;
// They are asked for where the level alone leaves no more than so many times the best.
constexpr double worth_refining = 10;

// Degrees of poling to try between those that have names, and steps around the best: to 0.02.
constexpr std::array degrees{-1.0, -0.85, -0.7, -0.4, -0.15, 0.0, 0.15, 0.4, 0.7, 0.85, 1.0};
constexpr std::size_t from_name_to_name = (degrees.size() - 1) / 2;
constexpr int refinements_of_degree = 6;

// What a coarse simulation is off by in each channel, percent of the range (study/fit.h): a past that is
// nearer than that is no likelier.
constexpr double not_seen = 0.5;

// A presumed past that leaves less than this of each channel's range, in percent, is not doubted: what a
// model misses for other reasons is no less, while a start from the wrong side leaves 20 or more.
constexpr double little = 3;

struct Hypothesis {
  Past past;
  PastMisfit misfit{};
  int numbers = 0;         // that were free
  bool has_level = false;  // among them
};

double squares_of(const Hypothesis& h) {
  return h.misfit.squares;
}

// The golden section between two places; `at` remembers what it is asked for.
template <class At>
void golden_section(double low, double high, int steps, At&& at) {
  constexpr double golden = 0.6180339887498949;
  double a = high - golden * (high - low), b = low + golden * (high - low);
  double at_a = at(a), at_b = at(b);
  for (int i = 0; i < steps; ++i) {
    if (at_a < at_b) {
      high = std::exchange(b, a);
      at_b = at_a;
      a = high - golden * (high - low);
      at_a = at(a);
    } else {
      low = std::exchange(a, b);
      at_a = at_b;
      b = low + golden * (high - low);
      at_b = at(b);
    }
  }
}

// Of one recording. Its pace is the mean of how fast its field goes.
class Search {
 public:
  Search(std::span<const double> time, std::span<const double> field, const PastSearch& how)
      : how_(how), largest_(largest_field(field)), pace_(mean_pace(time, field)) {}

  std::optional<FoundPast> likeliest() {
    std::optional<FoundPast> presumed;
    for (const auto& past : how_.presumed)
      if (const auto misfit = how_.misfit(past);
          std::isfinite(misfit.squares) && !(presumed && presumed->misfit.squares <= misfit.squares))
        presumed = {past, misfit};
    if (presumed && presumed->misfit.squares <= how_.not_doubted) return presumed;
    const auto found = likeliest_of_all();
    const bool stands =
        presumed && !(found && found->misfit.squares < most_left_by_another_past * presumed->misfit.squares);
    return stands ? presumed : found;
  }

  // Level and pace by damped Gauss-Newton steps, with slopes by differences: a level that was gone to more
  // slowly is not the same as a higher one.
  Hypothesis with_pace(Hypothesis from) {
    from.numbers = 2;
    auto left = how_.residual(from.past);
    const auto moved = [&](double share, double logarithm) {
      auto out = from.past;
      auto& level = out.levels.front();
      level.field = std::copysign(
          std::clamp(std::abs(level.field) + share * largest_, 0.0, farthest_level * largest_), level.field);
      level.seconds *= std::exp(logarithm);
      return out;
    };
    for (int i = 0; i < steps_of_pace; ++i) {
      Eigen::Matrix<double, Eigen::Dynamic, 2> slopes(left.size(), 2);
      slopes.col(0) = (how_.residual(moved(step_of_level, 0)) - left) / step_of_level;
      slopes.col(1) = (how_.residual(moved(0, step_of_logarithm)) - left) / step_of_logarithm;
      Eigen::Matrix2d normal = slopes.transpose() * slopes;
      const Eigen::Vector2d gradient = slopes.transpose() * left;
      double gained = 0;
      double damping = least_damping;
      for (int k = 0; k < dampings && gained <= 0; ++k) {
        Eigen::Matrix2d damped = normal;
        damped.diagonal() *= 1 + damping;
        damping *= more_damping;
        Eigen::Vector2d step = -damped.ldlt().solve(gradient);
        step *= std::min({1.0, most_of_level / std::abs(step[0]), most_of_logarithm / std::abs(step[1])});
        const auto past = moved(step[0], step[1]);
        const auto there = how_.misfit(past);
        if (!(there.squares < from.misfit.squares)) continue;
        gained = from.misfit.squares - there.squares;
        from.past = past;
        from.misfit = there;
      }
      if (gained < least_gain_of_pace) break;
      left = how_.residual(from.past);
    }
    return from;
  }

 private:
  std::optional<FoundPast> likeliest_of_all() {
    std::vector<Hypothesis> all;
    const auto add = [&](const Past& past) { all.push_back({past, how_.misfit(past)}); };
    if (!how_.cycled_alone) {
      for (const auto kind : {PastKind::poled_plus, PastKind::poled_minus, PastKind::unpoled}) add({kind});
      const auto best = std::ranges::min_element(all, {}, squares_of);
      if (best->misfit.squares <= how_.enough) return FoundPast{best->past, best->misfit};
    }
    std::vector<Hypothesis> cycled;
    for (const auto from : {FirstState::poled_minus, FirstState::unpoled, FirstState::poled_plus}) {
      const Past past{PastKind::cycled, from};
      cycled.push_back({past, how_.misfit(past)});
    }
    if (how_.degrees) cycled.push_back(partly_poled(cycled));
    all.insert(all.begin(), cycled.begin(), cycled.end());
    if (!how_.cycled_alone && pace_ > 0)
      for (const bool unpoled : {false, true}) {
        auto level = last_level(unpoled);
        if (how_.residual &&
            level.misfit.squares < worth_refining * std::ranges::min(all, {}, squares_of).misfit.squares)
          level = with_pace(std::move(level));
        all.push_back(std::move(level));
      }
    const auto* best = &*std::ranges::min_element(all, {}, squares_of);
    if (!std::isfinite(best->misfit.squares)) return std::nullopt;
    const double n = best->misfit.independent;
    const double of_level = how_.level_gain.value_or(-n * std::log(most_left_by_another_past));
    const auto found = std::ranges::min_element(all, {}, [&](const Hypothesis& h) {
      return n * std::log(h.misfit.squares + how_.not_seen) + h.numbers * std::log(n) +
             (h.has_level ? of_level : 0);
    });
    return FoundPast{found->past, found->misfit};
  }

  Past visited(double level, bool unpoled) const {
    const auto far_side = level < 0 ? FirstState::poled_plus : FirstState::poled_minus;
    return {PastKind::visited, unpoled ? FirstState::unpoled : far_side, {{level, std::abs(level) / pace_}}};
  }

  // Cycled from the degree of poling that fits best, by a grid and, around its best, by the golden section.
  // `named` is what was cycled from the degrees -1, 0 and 1.
  Hypothesis partly_poled(std::span<const Hypothesis> named) {
    std::vector<Hypothesis> tried;
    const auto at = [&](double degree) {
      const Past past{.kind = PastKind::cycled, .from = FirstState::partly_poled, .poling = degree};
      tried.push_back({past, how_.misfit(past), 1});
      return tried.back().misfit.squares;
    };
    std::array<double, degrees.size()> squares{};
    for (std::size_t k = 0; k < degrees.size(); ++k)
      squares.at(k) =
          k % from_name_to_name == 0 ? named[k / from_name_to_name].misfit.squares : at(degrees.at(k));
    const auto k = static_cast<std::size_t>(std::ranges::min_element(squares) - squares.begin());
    golden_section(degrees.at(k == 0 ? 0 : k - 1), degrees.at(std::min(k + 1, degrees.size() - 1)),
                   refinements_of_degree, at);
    return *std::ranges::min_element(tried, {}, squares_of);
  }

  // The extreme level by a grid and, around its best, by the golden section.
  Hypothesis last_level(bool unpoled) {
    std::vector<Hypothesis> tried;
    const auto at = [&](double level) {
      const auto past = visited(level, unpoled);
      tried.push_back({past, how_.misfit(past), 1, true});
      return tried.back().misfit.squares;
    };
    for (const double sign : {-1.0, 1.0})
      for (const double share : levels) at(sign * share * largest_);
    const auto place =
                   static_cast<std::size_t>(std::ranges::min_element(tried, {}, squares_of) - tried.begin()),
               side = place / levels.size(), k = place % levels.size();
    const double sign = side == 0 ? -1 : 1;
    golden_section(levels.at(k == 0 ? 0 : k - 1), levels.at(std::min(k + 1, levels.size() - 1)), refinements,
                   [&](double share) { return at(sign * share * largest_); });
    return *std::ranges::min_element(tried, {}, squares_of);
  }

  const PastSearch& how_;
  double largest_;  // V/m
  double pace_;     // V/m/s
};

// A channel's part, over its range.
void add(const MeasuredColumn& column, const std::vector<double>& answer, bool height_is_free,
         PastMisfit& to) {
  double mean = 0, along = 0, own = 0;
  for (const auto row : column.rows) mean += answer[row] / static_cast<double>(column.rows.size());
  std::vector<double> left(column.rows.size());
  for (std::size_t k = 0; k < left.size(); ++k) {
    left[k] = answer[column.rows[k]] - mean;
    along += left[k] * column.value[k];
    own += left[k] * left[k];
  }
  // A channel may be higher or lower than the model's, not upside down.
  const double height = height_is_free && own > 0 ? std::max(0.0, along / own) : 1;
  const double scale = residual_scale(column);
  for (std::size_t k = 0; k < left.size(); ++k) {
    left[k] = scale * (height * left[k] - column.value[k]);
    to.squares += left[k] * left[k];
  }
  to.independent +=
      std::max(1.0, static_cast<double>(left.size()) /
                        correlated_rows(Eigen::Map<const Eigen::VectorXd>(left.data(), std::ssize(left))));
}

PastMisfit misfit_over_range(std::span<const Model> models, const RecordingData& data,
                             const PastChoice& choice, const Past& past) {
  PastMisfit out;
  for (const auto& model : models) {
    if (choice.count) choice.count();
    const auto simulated = simulate_recorded(model_for(model, data.header), data, choice.fidelity, {}, &past);
    if (!simulated) continue;
    PastMisfit here{0, 0};
    for (const auto& column : data.columns)
      add(column, simulated->at(column.channel), choice.heights_are_free, here);
    if (here.squares < out.squares) out = here;
  }
  return out;
}

// The sum of squares where each channel is missed by so many percent of its range.
double squares_missed(double percent, const RecordingData& data) {
  return percent * percent * static_cast<double>(data.columns.size());
}

std::optional<FoundPast> likeliest_over_range(std::span<const Model> models, const RecordingData& data,
                                              const PastChoice& choice, std::vector<Past> presumed,
                                              double not_doubted) {
  // A degree shows in heights, and says nothing before these are known.
  const PastSearch how{
      .misfit = [&](const Past& past) { return misfit_over_range(models, data, choice, past); },
      .degrees = !choice.heights_are_free,
      .cycled_alone = choice.cycled_alone,
      .not_seen = squares_missed(not_seen, data),
      .level_gain = {},
      .presumed = std::move(presumed),
      .not_doubted = squares_missed(not_doubted, data)};
  return likeliest_past(data.drive.time, data.drive.field, how);
}

// The pasts of a file's tables under the hypothesis that is likeliest for all of them together, by the sum of
// n ln S over those that name no past.
const std::vector<Past>& likeliest_hypothesis(const Succession& tables, std::span<const Model> models,
                                              std::span<const RecordingData> data, const PastChoice& choice) {
  const auto& all = tables.hypotheses;
  std::vector<std::vector<double>> weighed(tables.recordings.size(), std::vector<double>(all.size(), 0));
  tbb::parallel_for(std::size_t{0}, tables.recordings.size(), [&](std::size_t t) {
    const auto& table = data[tables.recordings[t]];
    if (table.header.past.known()) return;
    std::vector<PastMisfit> misfits;
    misfits.reserve(all.size());
    for (const auto& pasts : all) misfits.push_back(misfit_over_range(models, table, choice, pasts[t]));
    const double n = std::ranges::min_element(misfits, {}, &PastMisfit::squares)->independent;
    for (std::size_t h = 0; h < all.size(); ++h)
      weighed[t][h] = n * std::log(misfits[h].squares + squares_missed(not_seen, table));
  });
  std::vector<double> sum(all.size(), 0);
  for (const auto& w : weighed)
    for (std::size_t h = 0; h < all.size(); ++h) sum[h] += w[h];
  return all[static_cast<std::size_t>(std::ranges::min_element(sum) - sum.begin())];
}

// Of each table of a file the past that those before it leave it; of other recordings none.
std::vector<std::vector<Past>> presumed_pasts(std::span<const Model> models,
                                              std::span<const RecordingData> data, const PastChoice& choice) {
  std::vector<std::vector<Past>> out(data.size());
  for (const auto& tables : successions(data)) {
    const auto& pasts = likeliest_hypothesis(tables, models, data, choice);
    for (std::size_t t = 0; t < pasts.size(); ++t)
      if (pasts[t].known()) out[tables.recordings[t]] = {pasts[t]};
  }
  return out;
}

}  // namespace

std::optional<FoundPast> likeliest_past(std::span<const double> time, std::span<const double> field,
                                        const PastSearch& how) {
  return Search(time, field, how).likeliest();
}

FoundPast refined_past(std::span<const double> field, const Past& visit, const PastSearch& how) {
  const auto found = Search({}, field, how).with_pace({visit, how.misfit(visit)});
  return {found.past, found.misfit};
}

std::optional<Past> choose_past_alone(std::span<const Model> models, const RecordingData& data,
                                      const PastChoice& choice) {
  const auto found = likeliest_over_range(models, data, choice, {}, 0);
  return found ? std::optional(found->past) : std::nullopt;
}

std::vector<Past> choose_pasts(std::span<const Model> models, std::span<const RecordingData> data,
                               const PastChoice& choice) {
  std::vector<Past> out;
  out.reserve(data.size());
  for (const auto& d : data) out.push_back(d.header.past.known() ? d.header.past : d.past);
  const auto of_tables = presumed_pasts(models, data, choice);
  std::vector<std::size_t> unknown;        // the recordings that name no past
  std::vector<std::size_t> alone, tables;  // of these; tables of one file follow each other
  for (std::size_t i = 0; i < data.size(); ++i)
    if (!data[i].header.past.known()) {
      unknown.push_back(i);
      (of_tables[i].empty() ? alone : tables).push_back(i);
    }

  const auto choose = [&](const std::vector<std::size_t>& which, const auto& presumed, double not_doubted) {
    tbb::parallel_for(std::size_t{0}, which.size(), [&](std::size_t k) {
      const auto i = which[k];
      if (const auto found = likeliest_over_range(models, data[i], choice, presumed(i), not_doubted))
        out[i] = found->past;
    });
  };
  bool contradicted = true;
  if (choice.presumed) {
    for (const auto i : alone) out[i] = *choice.presumed;
    choose(
        alone, [&](std::size_t) { return std::vector{*choice.presumed}; }, little);
    contradicted = std::ranges::any_of(alone, [&](std::size_t i) { return out[i] != *choice.presumed; });
  }
  // A model whose heights are not known yet says too little against what was measured before.
  choose(
      contradicted ? unknown : tables, [&](std::size_t i) { return of_tables[i]; },
      choice.heights_are_free ? std::numeric_limits<double>::infinity() : little);
  return out;
}

}  // namespace ferrobench::model
