#include "model/inference/search/pasts.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>

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
// The share of what the presumed past leaves that another one may leave to be believed.
constexpr double much_less = 0.5;

struct Misfit {
  double squares = std::numeric_limits<double>::infinity();
  double independent = 1;  // rows
};

struct Hypothesis {
  Past past;
  Misfit misfit{};
  int numbers = 0;            // that were free
  bool has_to_halve = false;  // the sum of squares
};

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
class Judge {
 public:
  Judge(std::span<const Model> models, const RecordingData& data, const PastChoice& choice)
      : models_(models), data_(data), choice_(choice) {
    const auto& [time, field] = data.drive;
    double path = 0;
    for (std::size_t k = 0; k < field.size(); ++k) {
      largest_ = std::max(largest_, std::abs(field[k]));
      if (k > 0) path += std::abs(field[k] - field[k - 1]);
    }
    if (time.size() > 1) pace_ = path / (time.back() - time.front());
  }

  Past likeliest() { return likeliest_of_all().past; }
  // Whether the presumed past leaves much that another one does not.
  bool contradicts_presumed() {
    const double presumed = misfit(*choice_.presumed).squares;
    if (presumed <= little * little * static_cast<double>(data_.columns.size())) return false;
    return likeliest_of_all().misfit.squares < much_less * presumed;
  }

 private:
  Hypothesis likeliest_of_all() {
    std::vector<Hypothesis> all;
    const auto add = [&](const Past& past, int numbers) {
      all.push_back({past, misfit(past), numbers, numbers > 0});
    };
    for (const auto from : {FirstState::poled_minus, FirstState::unpoled, FirstState::poled_plus})
      add({PastKind::cycled, from}, 0);
    // A degree shows in heights, and says nothing before these are known.
    if (!choice_.heights_are_free) all.push_back(partly_poled(all));
    if (!choice_.cycled_alone) {
      for (const auto kind : {PastKind::poled_plus, PastKind::poled_minus, PastKind::unpoled}) add({kind}, 0);
      for (const bool unpoled : {false, true})
        if (pace_ > 0) add(last_level(unpoled), 1);
    }
    const auto* best =
        &*std::ranges::min_element(all, {}, [](const Hypothesis& h) { return h.misfit.squares; });
    if (!std::isfinite(best->misfit.squares)) return {data_.past};
    const double n = best->misfit.independent;
    const double floor = not_seen * not_seen * static_cast<double>(data_.columns.size());
    return *std::ranges::min_element(all, {}, [&](const Hypothesis& h) {
      return n * std::log(h.misfit.squares + floor) + h.numbers * std::log(n) -
             (h.has_to_halve ? n * std::log(much_less) : 0);
    });
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
      tried.push_back({past, misfit(past), 1});
      return tried.back().misfit.squares;
    };
    std::array<double, degrees.size()> squares{};
    for (std::size_t k = 0; k < degrees.size(); ++k)
      squares.at(k) =
          k % from_name_to_name == 0 ? named[k / from_name_to_name].misfit.squares : at(degrees.at(k));
    const auto k = static_cast<std::size_t>(std::ranges::min_element(squares) - squares.begin());
    golden_section(degrees.at(k == 0 ? 0 : k - 1), degrees.at(std::min(k + 1, degrees.size() - 1)),
                   refinements_of_degree, at);
    return *std::ranges::min_element(tried, {}, [](const Hypothesis& h) { return h.misfit.squares; });
  }

  // The extreme level by a grid and, around its best, by the golden section.
  Past last_level(bool unpoled) {
    std::vector<std::pair<double, double>> tried;  // level, squares
    const auto at = [&](double level) {
      tried.emplace_back(level, misfit(visited(level, unpoled)).squares);
      return tried.back().second;
    };
    for (const double sign : {-1.0, 1.0})
      for (const double share : levels) at(sign * share * largest_);
    const auto best = std::ranges::min_element(tried, {}, &std::pair<double, double>::second);
    const auto place = static_cast<std::size_t>(best - tried.begin()), side = place / levels.size(),
               k = place % levels.size();
    const double sign = side == 0 ? -1 : 1;
    golden_section(levels.at(k == 0 ? 0 : k - 1), levels.at(std::min(k + 1, levels.size() - 1)), refinements,
                   [&](double share) { return at(sign * share * largest_); });
    return visited(std::ranges::min_element(tried, {}, &std::pair<double, double>::second)->first, unpoled);
  }

  Misfit misfit(const Past& past) {
    Misfit out;
    for (const auto& model : models_) {
      if (choice_.count) choice_.count();
      const auto simulated =
          simulate_recorded(model_for(model, data_.header), data_, choice_.fidelity, {}, &past);
      if (!simulated) continue;
      Misfit here{0, 0};
      for (const auto& column : data_.columns) add(column, simulated->at(column.channel), here);
      if (here.squares < out.squares) out = here;
    }
    return out;
  }

  void add(const MeasuredColumn& column, const std::vector<double>& answer, Misfit& to) const {
    double mean = 0, along = 0, own = 0;
    for (const auto row : column.rows) mean += answer[row] / static_cast<double>(column.rows.size());
    std::vector<double> left(column.rows.size());
    for (std::size_t k = 0; k < left.size(); ++k) {
      left[k] = answer[column.rows[k]] - mean;
      along += left[k] * column.value[k];
      own += left[k] * left[k];
    }
    // A channel may be higher or lower than the model's, not upside down.
    const double height = choice_.heights_are_free && own > 0 ? std::max(0.0, along / own) : 1;
    const double scale = residual_scale(column);
    for (std::size_t k = 0; k < left.size(); ++k) {
      left[k] = scale * (height * left[k] - column.value[k]);
      to.squares += left[k] * left[k];
    }
    to.independent +=
        std::max(1.0, static_cast<double>(left.size()) /
                          correlated_rows(Eigen::Map<const Eigen::VectorXd>(left.data(), std::ssize(left))));
  }

  std::span<const Model> models_;
  const RecordingData& data_;
  const PastChoice& choice_;
  double largest_ = 0, pace_ = 0;  // V/m, V/m/s
};

}  // namespace

std::vector<Past> choose_pasts(std::span<const Model> models, std::span<const RecordingData> data,
                               const PastChoice& choice) {
  std::vector<Past> out(data.size());
  const auto known = [&](std::size_t i) { return data[i].header.past.known(); };
  if (choice.presumed) {
    std::atomic<bool> contradicted = false;
    tbb::parallel_for(std::size_t{0}, data.size(), [&](std::size_t i) {
      if (!known(i) && Judge(models, data[i], choice).contradicts_presumed()) contradicted = true;
    });
    if (!contradicted) {
      for (std::size_t i = 0; i < data.size(); ++i)
        out[i] = known(i) ? data[i].header.past : *choice.presumed;
      return out;
    }
  }
  tbb::parallel_for(std::size_t{0}, data.size(), [&](std::size_t i) {
    out[i] = known(i) ? data[i].header.past : Judge(models, data[i], choice).likeliest();
  });
  return out;
}

}  // namespace ferrobench::model
