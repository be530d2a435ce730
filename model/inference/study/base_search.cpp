#include "model/inference/study/base_search.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "model/inference/common/parallel.h"
#include "model/inference/residuals/separable.h"
#include "model/inference/search/global_start.h"
#include "model/inference/study/fit.h"

namespace ferrobench::model::inference {
namespace {

// Effects that are searched to the end, and from which least squares go on.
constexpr std::size_t refined = 2;
// Programs within this of each other, in duration and in reach, are alike.
constexpr double alike = 0.1;

// A plausible value of each of its parameters.
EffectSetting plausible(const Effect& effect) {
  EffectSetting out{.id = std::string(effect.id), .parameters = {}};
  for (const auto& p : effect.parameters) out.parameters.emplace_back(p.name, std::sqrt(p.low * p.high));
  return out;
}

// How long it lasts and how far it reaches.
struct Program {
  explicit Program(const Drive& drive) : duration(drive.time.back() - drive.time.front()) {
    const auto [low, high] = std::ranges::minmax(drive.field);
    reach = high - low;
  }
  bool is_like(const Program& other) const {
    const auto close = [](double a, double b) { return std::abs(a - b) <= alike * std::max(a, b); };
    return close(duration, other.duration) && close(reach, other.reach);
  }
  double duration = 0, reach = 0;
};

struct Begun {
  const Effect* effect = nullptr;
  std::unique_ptr<const Model> model;  // which the search refers to
  std::unique_ptr<GlobalStart> search{};
  double squares() const { return search->squares(); }
};

// The base alone, then effects by what they leave.
std::pair<bool, double> by_squares(const Begun& b) {
  return {b.effect != nullptr, b.squares()};
}

class BaseSearch {
 public:
  BaseSearch(const std::vector<RecordingData>& recordings, const BaseSearchOptions& options)
      : residuals_(recording_residuals(recordings)), options_(options) {
    coarse_.simulation = options.simulation;
    coarse_.simulation.domains = FitOptions{}.coarse.domains;
    coarse_.simulation.tolerance = FitOptions{}.coarse.tolerance;
    coarse_.simulation.every_spread = false;
    coarse_.coarse = true;
  }

  bool is_separable(const Model& base) const { return residuals_->separable(base, free_of(base)) != nullptr; }

  std::vector<SearchedBase> run(std::vector<Begun> all) {
    const auto most = refined + 1;
    expected_ =
        static_cast<double>(all.size() + std::min(all.size(), most)) * most_simulations_of_half_a_search();
    for (auto& b : all) b.search = search(*b.model);
    advance(all);
    all.resize(std::min(all.size(), most));
    advance(all);
    // What an effect's search found that is worse than the base alone is of no use.
    const double alone = all.front().squares();
    std::erase_if(all, [&](const Begun& b) {
      return !b.search->best() || (b.effect != nullptr && b.squares() >= alone);
    });
    std::vector<SearchedBase> out(all.size());
    in_parallel(all.size(), options_.threads, [&](std::size_t i) { out[i] = refine(all[i]); });
    std::erase_if(out, [](const SearchedBase& b) { return !std::isfinite(b.squares); });
    std::ranges::stable_sort(out, {},
                             [](const SearchedBase& b) { return std::pair(b.effect != nullptr, b.squares); });
    return out;
  }

 private:
  std::vector<FreeParameter> free_of(const Model& base) const {
    return default_free_parameters(base, evidence_of(residuals_->recordings()));
  }
  std::unique_ptr<GlobalStart> search(const Model& from) {
    return std::make_unique<GlobalStart>(
        from, *residuals_,
        GlobalStartOptions{.free = free_of(from),
                           .fidelity = coarse_,
                           .first = {from},
                           .seed = options_.seed,
                           .count = [this] {
                             options_.tick("searching the whole range of the base model",
                                           0.7 * std::min(1.0, ++done_ / expected_));
                           }});
  }
  void advance(std::vector<Begun>& all) const {
    in_parallel(all.size(), options_.threads, [&](std::size_t i) { all[i].search->advance(); });
    std::ranges::stable_sort(all, {}, by_squares);
  }

  SearchedBase refine(const Begun& begun) const {
    FitOptions how;
    how.free = free_of(*begun.model);
    how.starts = 1;
    how.simulation = options_.simulation;
    how.simulation.domains = how.middle.domains;  // what is accepted is fitted again, more finely
    how.simulation.tolerance = how.middle.tolerance;
    how.progress = [this](const FitProgress& p) {
      options_.tick("fitting what the search found", 0.7 + 0.3 * p.fraction);
      return true;
    };
    try {
      auto fitted = fit(*begun.search->best(), *residuals_, how);
      return {begun.effect, std::move(fitted.model), fitted.cost_after};
    } catch (const Error& failure) {
      // What the coarse simulation of the search could solve, the fine one cannot.
      if (failure.code() != ErrorCode::numerical) throw;
      return {begun.effect, *begun.model, std::numeric_limits<double>::infinity()};
    }
  }

  std::shared_ptr<const ResidualModel> residuals_;
  const BaseSearchOptions& options_;
  Fidelity coarse_;
  std::atomic<int> done_ = 0;
  double expected_ = 1;
};

}  // namespace

std::vector<SearchedBase> search_bases(const Model& base, const std::vector<const Effect*>& candidates,
                                       const std::vector<RecordingData>& recordings,
                                       const BaseSearchOptions& options) {
  std::vector<Begun> all;
  all.push_back({.effect = nullptr, .model = std::make_unique<Model>(base)});
  for (const auto* effect : candidates) {
    if (effect->family != Family::kinetics) continue;
    auto with = std::make_unique<Model>(base);
    with->effects.push_back(plausible(*effect));
    all.push_back({.effect = effect, .model = std::move(with)});
  }
  BaseSearch search(recordings, options);
  if (!search.is_separable(base)) return {};
  return search.run(std::move(all));
}

std::vector<RecordingData> recordings_of_search(const std::vector<RecordingData>& data,
                                                const std::vector<BenchRecording>& bench,
                                                const std::vector<std::vector<NoiseModel>>& errors,
                                                const std::vector<std::size_t>& chosen) {
  std::vector<Program> seen;
  std::vector<RecordingData> out;
  for (const auto r : chosen) {
    const Program own(data[r].drive);
    if (std::ranges::any_of(seen, [&](const Program& p) { return p.is_like(own); })) continue;
    seen.push_back(own);
    auto& d = out.emplace_back(data[r]);
    d.past = bench[r].header.past;
    for (auto& column : d.columns)
      for (std::size_t c = 0; c < bench[r].channels.size(); ++c)
        if (bench[r].channels[c].channel == column.channel)
          column.error = std::hypot(errors[r][c].std(), errors[r][c].model_error);
  }
  return out;
}

}  // namespace ferrobench::model::inference
