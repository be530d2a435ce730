#include "model/inference/study/fit.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <tuple>

#include "model/inference/residuals/separable.h"
#include "model/inference/search/global_search.h"
#include "model/inference/solver/least_squares.h"

namespace ferrobench::model {
namespace {

// Where minima are only looked for: 128 domains leave 0.15 % of the range on the loops of a ceramic, which
// the model misses by 5 %, at a tenth of the cost.
constexpr int coarse_domains = 128;
constexpr double coarse_tolerance = 1e-3;
constexpr double unsolvable =
    1e9;  // sum of squares that a global search sees where a model cannot be simulated

struct Candidate {
  std::vector<double> at;
  double squares = std::numeric_limits<double>::infinity();
};

// What all threads of a fit share: the caller's wishes, asked one at a time, and the best so far.
class Watch {
 public:
  explicit Watch(const FitOptions& options) : options_(options) {
    stop_ = [this] {
      const std::lock_guard lock(mutex_);
      if (!stopped_ && options_.simulation.stop != nullptr) stopped_ = (*options_.simulation.stop)();
      return stopped_;
    };
  }

  const std::function<bool()>* stop() const { return &stop_; }
  void stage(std::string name, double from, double to, int simulations) {
    const std::lock_guard lock(mutex_);
    progress_.stage = std::move(name);
    from_ = from;
    to_ = to;
    expected_ = std::max(1, simulations);
    done_ = 0;
  }
  // Before each simulation. Throws Error(cancelled) once the caller wants no more; the first is always made.
  void count() {
    const std::lock_guard lock(mutex_);
    ++done_;
    progress_.fraction = from_ + (to_ - from_) * std::min(1.0, static_cast<double>(done_) / expected_);
    if (simulations_++ > 0 && !stopped_ && options_.progress) stopped_ = !options_.progress(progress_);
    if (stopped_) throw Error(ErrorCode::cancelled, "the fit was stopped");
  }
  void keep(double squares, std::span<const double> at) {
    const std::lock_guard lock(mutex_);
    if (squares >= best_.squares) return;
    best_ = {{at.begin(), at.end()}, squares};
    progress_.cost = squares;
  }
  Candidate best() {
    const std::lock_guard lock(mutex_);
    return best_;
  }
  int simulations() const { return simulations_; }

 private:
  const FitOptions& options_;
  std::function<bool()> stop_;
  std::mutex mutex_;
  FitProgress progress_;
  double from_ = 0, to_ = 1;
  int expected_ = 1, done_ = 0, simulations_ = 0;
  bool stopped_ = false;
  Candidate best_;
};

class Study {
 public:
  Study(const Model& start, const ResidualModel& residuals, const FitOptions& options)
      : start_(start), residuals_(residuals), options_(options), watch_(options) {
    fine_.simulation = options.simulation;
    fine_.simulation.stop = watch_.stop();
    coarse_ = fine_;
    coarse_.simulation.tolerance = std::max(coarse_tolerance, fine_.simulation.tolerance);
    const int domains = fine_.simulation.domains;
    coarse_.simulation.domains = domains > 0 ? std::min(domains, coarse_domains) : coarse_domains;
    coarse_.coarse = true;
    given_ = unit_of(start);
  }

  FitResult run() {
    FitResult out;
    out.model = start_;
    Candidate fine{given_, first_squares()};
    out.cost_before = fine.squares;
    watch_.keep(fine.squares, fine.at);
    try {
      if (options_.starts > 1) fine.at = best_start();
      watch_.stage("solving", options_.starts > 1 ? 0.8 : 0, 0.95, solution());
      fine = solve(fine.at, fine_, true);
      if (!(fine.squares <= out.cost_before)) fine = watch_.best();
      watch_.stage("estimating uncertainty", 0.95, 1, 2 * parameters());
      uncertainty(fine.at, out);
    } catch (const Error& e) {
      if (e.code() != ErrorCode::cancelled) throw;
      out.stopped = true;
      fine = watch_.best();
      out.parameters.clear();
    }
    out.model = model_at(fine.at);
    out.cost_after = fine.squares;
    out.simulations = watch_.simulations();
    out.parameters.resize(options_.free.size());
    for (std::size_t i = 0; i < options_.free.size(); ++i) {
      auto& p = out.parameters[i];
      p.free = options_.free[i];
      p.from = get_parameter(start_, p.free.path);
      p.to = get_parameter(out.model, p.free.path);
      p.at_bound = fine.at[i] < 0.01 || fine.at[i] > 0.99;
      p.determined = p.determined && !p.at_bound;
    }
    return out;
  }

 private:
  int parameters() const { return static_cast<int>(options_.free.size()); }
  // Simulations of a least-squares solution, about.
  int solution() const { return options_.iterations * (1 + 2 * parameters()); }

  // Simulations of a global search, about.
  int search_simulations() const {
    const GlobalSearchOptions options;
    const int once = options.population * options.generations;
    return residuals_.separable(start_, options_.free) ? once : 2 * once;
  }

  std::vector<double> unit_of(const Model& m) const {
    std::vector<double> out;
    for (const auto& p : options_.free) out.push_back(to_unit(p, get_parameter(m, p.path)));
    return out;
  }
  Model model_at(std::span<const double> unit) const {
    std::vector<std::pair<std::string, double>> values;
    for (std::size_t i = 0; i < unit.size(); ++i)
      // A parameter that stays where it was keeps all its digits, even outside of its range.
      if (unit[i] != given_[i])
        values.emplace_back(options_.free[i].path, from_unit(options_.free[i], unit[i]));
    return with_parameters(start_, values);
  }

  // Infinite where the model cannot be simulated.
  double squares(const Model& m, const Fidelity& fidelity) {
    std::vector<double> r(residuals_.size());
    watch_.count();
    if (residuals_.evaluate(m, fidelity, r) == Solved::no) return std::numeric_limits<double>::infinity();
    double sum = 0;
    for (const double v : r) sum += v * v;
    return sum;
  }

  double first_squares() {
    try {
      const double sum = squares(start_, fine_);
      if (std::isfinite(sum)) return sum;
    } catch (const Error& e) {
      if (e.code() != ErrorCode::cancelled) throw;
      throw Error(ErrorCode::cancelled, "the fit was stopped before its first simulation ended");
    }
    throw Error(ErrorCode::numerical,
                "the model to start from cannot be simulated in the experiments that it is to be fitted to");
  }

  ResidualFunction function(const Fidelity& fidelity) {
    return [this, &fidelity](std::span<const double> unit, std::span<double> out) {
      watch_.count();
      return residuals_.evaluate(model_at(unit), fidelity, out) == Solved::yes;
    };
  }

  Candidate solve(const std::vector<double>& from, const Fidelity& fidelity, bool keep) {
    LeastSquaresOptions options;
    options.iterations = options_.iterations;
    if (keep) options.progress = [this](double sum, std::span<const double> at) { watch_.keep(sum, at); };
    const auto f = function(fidelity);
    const auto result = least_squares(residuals_.size(), from, f, options);
    return {result.at, result.squares};
  }

  Candidate search(std::uint64_t seed) {
    GlobalSearchOptions options;
    options.seed = seed;
    const auto separable = residuals_.separable(start_, options_.free);
    const auto finite = [](double sum) { return std::isfinite(sum) ? sum : unsolvable; };
    if (separable) {
      const auto found = global_search(
          separable->dimensions(),
          [&](std::span<const double> unit) {
            watch_.count();
            const auto point = separable->at(unit, coarse_);
            if (point && point->squares < watch_.best().squares)
              watch_.keep(point->squares, unit_of(point->model));
            return point ? finite(point->squares) : unsolvable;
          },
          options);
      if (const auto point = separable->at(found.at, coarse_)) return {unit_of(point->model), point->squares};
      return {};
    }
    options.generations *= 2;
    const auto found = global_search(
        given_.size(),
        [&](std::span<const double> unit) {
          const double sum = squares(model_at(unit), coarse_);
          watch_.keep(sum, unit);
          return finite(sum);
        },
        options);
    return {found.at, found.value};
  }

  std::vector<double> best_start() {
    const auto searches = static_cast<std::size_t>(options_.starts - 1);
    std::vector<Candidate> found(searches + 1);
    found[0].at = given_;
    watch_.stage("searching", 0, 0.5, static_cast<int>(searches) * search_simulations());
    tbb::parallel_for(std::size_t{1}, found.size(),
                      [&](std::size_t i) { found[i] = search(options_.seed * 1000 + i); });
    watch_.stage("solving from each start", 0.5, 0.8, options_.starts * solution());
    for (auto& c : found)
      if (!c.at.empty()) c = solve(c.at, coarse_, false);
    return std::ranges::min_element(found, {}, &Candidate::squares)->at;
  }

  // Rows over which the residuals of a part stay correlated: 1 + 2 times the sum of their autocorrelation up
  // to its first zero. Cells of a table are independent measurements.
  static double correlated_rows(const Eigen::Ref<const Eigen::VectorXd>& r) {
    const auto n = r.size();
    const double variance = r.squaredNorm();
    double sum = 1;
    for (Eigen::Index lag = 1; lag < n / 2 && variance > 0; ++lag) {
      const double rho = r.head(n - lag).dot(r.tail(n - lag)) / variance;
      if (rho <= 0) break;
      sum += 2 * rho;
    }
    return sum;
  }

  void uncertainty(const std::vector<double>& at, FitResult& out) {
    const auto f = function(fine_);
    const auto slopes = jacobian(residuals_.size(), at, f, LeastSquaresOptions{}.difference);
    Eigen::VectorXd r(static_cast<Eigen::Index>(residuals_.size()));
    const bool solved = f(at, {r.data(), residuals_.size()});
    const auto n = static_cast<Eigen::Index>(at.size());
    out.parameters.resize(at.size());
    if (slopes.size() == 0 || !solved) return;
    const double freedom = std::max<double>(1, static_cast<double>(r.size() - n));
    const double variance = std::max(r.squaredNorm() / freedom, 1e-300);
    constexpr double prior = 12;  // 1 / variance of a uniform distribution over [0, 1]
    const Eigen::MatrixXd range = prior * Eigen::MatrixXd::Identity(n, n);
    Eigen::MatrixXd information = range, spread = range;
    for (const auto& part : residuals_.parts()) {
      const auto first = static_cast<Eigen::Index>(part.first), count = static_cast<Eigen::Index>(part.count);
      const auto j = slopes.middleRows(first, count);
      const auto rows = r.segment(first, count);
      const Eigen::MatrixXd square = j.transpose() * j / variance;
      information += square;
      spread += correlated_rows(rows) * rows.squaredNorm() / static_cast<double>(count) / variance * square;
    }
    const Eigen::MatrixXd inverse = information.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
    const Eigen::MatrixXd covariance = inverse * spread * inverse;
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      auto& p = out.parameters[k];
      const auto& free = options_.free[k];
      const double deviation = std::sqrt(covariance(i, i));
      constexpr double quantile = 1.96;  // of the normal distribution, 95 % two-sided
      const double below = at[k] - quantile * deviation, above = at[k] + quantile * deviation;
      std::tie(p.low, p.high) = std::minmax({from_unit(free, below), from_unit(free, above)});
      constexpr double step = 1e-4;
      p.std = std::abs(from_unit(free, at[k] + step) - from_unit(free, at[k] - step)) /
              (std::min(1.0, at[k] + step) - std::max(0.0, at[k] - step)) * deviation;
      p.determined = above - below < 0.5;
      out.correlations.emplace_back();
      for (Eigen::Index l = 0; l < n; ++l)
        out.correlations.back().push_back(covariance(i, l) / std::sqrt(covariance(i, i) * covariance(l, l)));
    }
  }

  const Model& start_;
  const ResidualModel& residuals_;
  const FitOptions& options_;
  Watch watch_;
  Fidelity fine_, coarse_;
  std::vector<double> given_;
};

}  // namespace

FitResult fit(const Model& start, const ResidualModel& residuals, const FitOptions& options) {
  if (options.free.empty()) throw Error(ErrorCode::invalid_params, "a fit needs at least one free parameter");
  return Study(start, residuals, options).run();
}

}  // namespace ferrobench::model
