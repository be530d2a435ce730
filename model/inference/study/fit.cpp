#include "model/inference/study/fit.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <tuple>

#include "model/inference/search/features.h"
#include "model/inference/search/global_start.h"
#include "model/inference/search/pasts.h"
#include "model/inference/solver/covariance.h"
#include "model/inference/solver/least_squares.h"
#include "model/inference/study/fit_watch.h"

namespace ferrobench::model {
namespace {

// Steps of least squares from each start before pasts are chosen anew.
constexpr int first_steps = 5;
// Of the least sum of squares that a search found: what leaves more is in no valley as deep.
constexpr double worth_solving = 4;
// Before anything is known of the specimen.
const PastChoice likeliest_at_start{.fidelity = {}, .heights_are_free = true},
    cycled_at_start{.fidelity = {}, .heights_are_free = true, .cycled_alone = true};
// Times that pasts are chosen anew near the optimum: each moves them less.
constexpr int rounds = 3;
// Recordings whose past is doubted, at most: each takes up to a solution.
constexpr std::size_t most_doubted = 5;

class Study {
 public:
  Study(const Model& start, const ResidualModel& residuals, const FitOptions& options)
      : start_(start), residuals_(residuals), options_(options), watch_(options) {
    fine_.simulation = options.simulation;
    fine_.simulation.stop = watch_.stop();
    const auto simplified = [&](const SimulationFidelity& f) {
      Fidelity out = fine_;
      out.simulation.tolerance = std::max(f.tolerance, fine_.simulation.tolerance);
      const int domains = fine_.simulation.domains;
      out.simulation.domains = domains > 0 ? std::min(domains, f.domains) : f.domains;
      out.coarse = true;
      return out;
    };
    coarse_ = simplified(options.coarse);
    middle_ = simplified(options.middle);
    given_ = unit_of(start);
    const auto known = [](const RecordingData& d) { return d.header.past.known(); };
    chooses_ = !std::ranges::all_of(residuals.recordings(), known);
  }

  FitResult run() {
    FitResult out;
    out.model = start_;
    // The first simulation is made whatever happens, so that there is something to return.
    auto given = first();
    watch_.keep(given);
    auto best = given;
    try {
      watch_.stage(options_.starts > 1 ? "searching" : "solving", 0, 0.02, 100);
      if (choose(given, first_models(), likeliest_at_start)) best = given = evaluate(given, fine_);
      if (options_.starts > 1) best = best_start(given);
      watch_.stage("solving", options_.starts > 1 ? 0.6 : 0, 0.95, 2 * solution());
      if (options_.starts == 1) best = solve(best, middle_, options_.iterations);
      for (int round = 0; round < rounds && better_pasts(best, middle_, 1e-6); ++round) {
      }
      doubt_presumed_pasts(best);
      best = solve(best, fine_, options_.iterations, 1e-4);
      better_pasts(best, fine_, 1e-4);
      given.residuals = best.residuals;
      given = evaluate(given, fine_);
      if (!(best.squares <= given.squares)) best = given;
      watch_.stage("estimating uncertainty", 0.95, 1, 2 * parameters());
      uncertainty(best, out);
    } catch (const Error& e) {
      if (e.code() != ErrorCode::cancelled) throw;
      out.stopped = true;
      best = watch_.best();
      out.parameters.clear();
    }
    out.model = model_at(best.at);
    out.cost_before = given.squares;
    for (const auto& d : best.residuals->recordings())
      out.pasts.push_back({d.header.title, d.past, !d.header.past.known()});
    if (chooses_) out.residuals = best.residuals;
    out.cost_after = best.squares;
    out.simulations = watch_.simulations();
    out.parameters.resize(options_.free.size());
    for (std::size_t i = 0; i < options_.free.size(); ++i) {
      auto& p = out.parameters[i];
      p.free = options_.free[i];
      p.from = get_parameter(start_, p.free.path);
      p.to = get_parameter(out.model, p.free.path);
      p.at_bound = best.at[i] < 0.01 || best.at[i] > 0.99;
      p.determined = p.determined && !p.at_bound;
    }
    return out;
  }

 private:
  int parameters() const { return static_cast<int>(options_.free.size()); }
  // Simulations of a least-squares solution, about: few take all of their steps.
  int solution() const { return options_.iterations * (1 + 2 * parameters()) / 2; }

  std::vector<double> unit_of(const Model& m) const {
    std::vector<double> out;
    for (const auto& p : options_.free) out.push_back(to_unit(p, get_parameter(m, p.path)));
    return out;
  }
  Model model_at(std::span<const double> unit) const {
    Model out = start_;
    for (std::size_t i = 0; i < unit.size(); ++i)
      // A parameter that stays where it was keeps all its digits, even outside of its range.
      if (unit[i] != given_[i])
        set_parameter(out, options_.free[i].path, from_unit(options_.free[i], unit[i]));
    return out;
  }

  // The same place with its sum of squares, infinite where the model cannot be simulated.
  FitCandidate evaluate(FitCandidate c, const Fidelity& fidelity) {
    std::vector<double> r(c.residuals->size());
    c.squares = function(*c.residuals, fidelity)(c.at, r) ? sum_of_squares(r)
                                                          : std::numeric_limits<double>::infinity();
    return c;
  }

  FitCandidate first() {
    try {
      // Not owned: the caller's, which outlive the study.
      auto given = evaluate({{std::shared_ptr<void>(), &residuals_}, given_}, fine_);
      if (std::isfinite(given.squares)) return given;
    } catch (const Error& e) {
      if (e.code() != ErrorCode::cancelled) throw;
      throw Error(ErrorCode::cancelled, "the fit was stopped before its first simulation ended");
    }
    throw Error(ErrorCode::numerical,
                "the model to start from cannot be simulated in the experiments that it is to be fitted to");
  }

  ResidualFunction function(const ResidualModel& residuals, const Fidelity& fidelity) {
    return [this, &residuals, &fidelity](std::span<const double> unit, std::span<double> out) {
      watch_.count();
      return residuals.evaluate(model_at(unit), fidelity, out) == Solved::yes;
    };
  }

  SlopeFunction slopes(const ResidualModel& residuals, const Fidelity& fidelity) {
    return [this, &residuals, &fidelity](std::span<const double> unit, std::span<double> out,
                                         Eigen::MatrixXd& slopes) {
      watch_.count();
      if (residuals.evaluate_with_slopes(model_at(unit), fidelity, options_.free, out, slopes) == Solved::no)
        return false;
      for (std::size_t i = 0; i < unit.size(); ++i)
        slopes.col(static_cast<Eigen::Index>(i)) *= unit_slope(options_.free[i], unit[i]);
      return true;
    };
  }

  FitCandidate solve(const FitCandidate& from, const Fidelity& fidelity, int iterations,
                     double tolerance = 1e-6) {
    const auto& residuals = *from.residuals;
    LeastSquaresOptions options;
    options.tolerance = tolerance;
    options.iterations = iterations;
    options.slopes = slopes(residuals, fidelity);
    FitCandidate last{from.residuals, from.at};  // where it cannot be simulated, a sum without end
    options.progress = [&](double squares, std::span<const double> at) {
      last = {from.residuals, {at.begin(), at.end()}, squares};
      watch_.keep(last);
    };
    least_squares(residuals.size(), from.at, function(residuals, fidelity), options);
    return last;
  }

  // Gives the candidate the likeliest pasts under these models, where recordings name none; whether any is
  // another one than it was.
  bool choose(FitCandidate& c, const std::vector<Model>& models, const PastChoice& how) {
    if (!chooses_) return false;
    auto choice = how;
    choice.fidelity = coarse_;
    choice.count = [this] { watch_.count(); };
    const auto data = c.residuals->recordings();
    const auto pasts = choose_pasts(models, data, choice);
    if (std::ranges::equal(pasts, data, {}, {}, &RecordingData::past)) return false;
    c.residuals = c.residuals->with_pasts(pasts);
    return true;
  }
  bool choose_anew(FitCandidate& c) { return choose(c, {model_at(c.at)}, {}); }
  // Solves again under pasts that are likelier for where it stands, and keeps them if that leads farther
  // down: they are judged by a coarse simulation.
  bool better_pasts(FitCandidate& best, const Fidelity& fidelity, double tolerance) {
    auto other = best;
    if (!choose_anew(other)) return false;
    other = solve(other, fidelity, options_.iterations, tolerance);
    if (!(other.squares < best.squares)) return false;
    best = std::move(other);
    return true;
  }

  // The sum of squares of each recording; empty where the model cannot be simulated.
  std::vector<double> squares_of_each(const FitCandidate& c) {
    std::vector<double> rows(c.residuals->size()), out;
    if (!function(*c.residuals, middle_)(c.at, rows)) return out;
    auto part = c.residuals->parts().begin();  // one for each column of each recording
    for (const auto& recording : c.residuals->recordings()) {
      out.push_back(0);
      for (std::size_t column = 0; column < recording.columns.size(); ++column, ++part)
        out.back() += sum_of_squares(std::span(rows).subspan(part->first, part->count));
    }
    return out;
  }

  // A past that follows from the tables before is doubted where its recording is met worse than they are in
  // the mean. The numbers were fitted to that past, and where they stand no other one is likelier, though
  // others may lie far below: numbers that were fitted beside the other one are compared.
  void doubt_presumed_pasts(FitCandidate& best) {
    if (!chooses_) return;
    const auto left = squares_of_each(best);
    const auto recordings = best.residuals->recordings();
    std::vector<std::size_t> doubted;
    for (std::size_t i = 0; i < left.size(); ++i)
      if (!recordings[i].header.past.known() && recordings[i].past.kind == protocols::PastKind::visited &&
          left[i] * static_cast<double>(left.size()) > best.squares)
        doubted.push_back(i);
    std::ranges::sort(doubted, std::greater{}, [&](std::size_t i) { return left[i]; });
    doubted.resize(std::min(doubted.size(), most_doubted));
    for (const auto i : doubted)
      if (auto other = under_another_past(best, i);
          best.squares - other.squares > (1 - most_left_by_another_past) * left[i])
        best = std::move(other);
  }
  // With the likeliest past of one recording, whatever the tables before it say.
  FitCandidate under_another_past(const FitCandidate& best, std::size_t recording) {
    auto out = best;
    for (int i = 0; i < 2; ++i) {
      const auto data = out.residuals->recordings();
      const auto model = model_at(out.at);
      const auto past = choose_past_alone({&model, 1}, data[recording],
                                          {.fidelity = coarse_, .count = [this] { watch_.count(); }});
      if (!past || (i == 0 && *past == data[recording].past)) return best;
      std::vector<protocols::Past> pasts;
      pasts.reserve(data.size());
      for (const auto& d : data) pasts.push_back(d.past);
      pasts[recording] = *past;
      out.residuals = out.residuals->with_pasts(pasts);
      out = solve(out, middle_, first_steps);
    }
    return out.squares < best.squares ? solve(out, middle_, options_.iterations) : out;
  }

  // From the given model and from what the data show, if that is more.
  std::vector<Model> first_models() const {
    std::vector<Model> out{start_};
    if (const auto shown = start_from_features(start_, options_.free, residuals_.recordings()))
      out.push_back(*shown);
    return out;
  }

  std::unique_ptr<GlobalStart> search(const std::shared_ptr<const ResidualModel>& residuals,
                                      std::uint64_t seed, const std::vector<Model>& models) {
    return std::make_unique<GlobalStart>(
        start_, *residuals,
        GlobalStartOptions{.free = options_.free,
                           .fidelity = coarse_,
                           .first = models,
                           .seed = seed,
                           .count = [this] { watch_.count(); },
                           .better =
                               [this, residuals](const Model& m, double squares) {
                                 watch_.keep({residuals, unit_of(m), squares});
                               }});
  }

  // Pasts that searches begin with, in turn: the likeliest and, as these were chosen before anything is known
  // of the specimen, that all were cycled, which is what testers do.
  std::vector<std::shared_ptr<const ResidualModel>> first_pasts(const FitCandidate& given,
                                                                const std::vector<Model>& models) {
    auto cycled = given;
    if (!choose(cycled, models, cycled_at_start)) return {given.residuals};
    return {given.residuals, cycled.residuals};
  }

  // What global searches find: of all after half of their way, the best go on.
  std::vector<FitCandidate> searched(const FitCandidate& given, const std::vector<Model>& models) {
    const auto pasts = first_pasts(given, models);
    const auto searches = static_cast<std::size_t>(options_.starts - 1);
    const auto refined = std::min(searches, static_cast<std::size_t>(options_.refined));
    watch_.stage("searching", 0, 0.4,
                 static_cast<int>(searches + refined) * most_simulations_of_half_a_search());
    struct Start {
      std::shared_ptr<const ResidualModel> residuals;
      std::unique_ptr<GlobalStart> search;
    };
    std::vector<Start> all;
    for (std::size_t i = 0; i < searches; ++i) {
      const auto& residuals = pasts[i % pasts.size()];
      all.push_back({residuals, search(residuals, options_.seed * 1000 + i, models)});
    }
    const auto advance = [&] {
      tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t i) { all[i].search->advance(); });
      std::ranges::stable_sort(all, {}, [](const Start& s) { return s.search->squares(); });
    };
    advance();
    all.resize(refined);
    advance();
    std::vector<FitCandidate> out;
    for (const auto& s : all)
      if (s.search->best()) out.push_back({s.residuals, unit_of(*s.search->best()), s.search->squares()});
    return out;
  }

  FitCandidate best_start(const FitCandidate& given) {
    const auto models = first_models();
    auto found = searched(given, models);
    // The models that the searches began with, where these have not left them far behind.
    const double best = found.empty() ? std::numeric_limits<double>::infinity() : found.front().squares;
    for (const auto& m : models)
      if (auto c = evaluate({given.residuals, unit_of(m)}, coarse_); c.squares <= worth_solving * best)
        found.push_back(std::move(c));
    watch_.stage("solving from each start", 0.4, 0.6,
                 static_cast<int>(found.size()) * (first_steps * 2 * parameters() + solution()));
    for (auto& c : found) {
      c = solve(c, middle_, first_steps);
      if (choose_anew(c)) c = solve(c, middle_, first_steps);
      c = solve(c, middle_, options_.iterations);
    }
    return *std::ranges::min_element(found, {}, &FitCandidate::squares);
  }

  void uncertainty(const FitCandidate& best, FitResult& out) {
    const auto& at = best.at;
    const auto& residuals = *best.residuals;
    out.parameters.resize(at.size());
    Eigen::VectorXd r(static_cast<Eigen::Index>(residuals.size()));
    const std::span<double> rows(r.data(), residuals.size());
    Eigen::MatrixXd j;
    if (!slopes(residuals, fine_)(at, rows, j)) {
      const auto f = function(residuals, fine_);
      if (!f(at, rows)) return;
      j = jacobian(r, at, f, LeastSquaresOptions{}.difference);
    }
    const auto c = covariance(residuals.parts(), r, j);
    for (Eigen::Index i = 0; i < c.rows(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      auto& p = out.parameters[k];
      const auto& free = options_.free[k];
      const double deviation = std::sqrt(c(i, i));
      constexpr double quantile = 1.96;  // of the normal distribution, 95 % two-sided
      const double below = at[k] - quantile * deviation, above = at[k] + quantile * deviation;
      std::tie(p.low, p.high) = std::minmax({from_unit(free, below), from_unit(free, above)});
      constexpr double step = 1e-4;
      p.std = std::abs(from_unit(free, at[k] + step) - from_unit(free, at[k] - step)) /
              (std::min(1.0, at[k] + step) - std::max(0.0, at[k] - step)) * deviation;
      p.determined = above - below < 0.5;
      out.correlations.emplace_back();
      for (Eigen::Index l = 0; l < c.cols(); ++l)
        out.correlations.back().push_back(c(i, l) / std::sqrt(c(i, i) * c(l, l)));
    }
  }

  const Model& start_;
  const ResidualModel& residuals_;
  const FitOptions& options_;
  FitWatch watch_;
  Fidelity fine_, middle_, coarse_;
  std::vector<double> given_;
  bool chooses_ = false;  // pasts of recordings that name none
};

}  // namespace

FitResult fit(const Model& start, const ResidualModel& residuals, const FitOptions& options) {
  if (options.free.empty()) throw Error(ErrorCode::invalid_params, "a fit needs at least one free parameter");
  return Study(start, residuals, options).run();
}

}  // namespace ferrobench::model
