#include "model/inference/search/global_start.h"

#include <cmath>
#include <utility>

namespace ferrobench::model {
namespace {

// Fewer leave the valley to be missed, more find the same (inference/README.md, section 9).
constexpr int generations_of_half = 50;
// What the search sees where a model cannot be simulated.
constexpr double unsolvable = 1e9;

}  // namespace

GlobalStart::GlobalStart(const Model& start, const ResidualModel& residuals, GlobalStartOptions options)
    : start_(start),
      residuals_(residuals),
      options_(std::move(options)),
      separable_(residuals.separable(start, options_.free)) {}

void GlobalStart::advance() {
  if (!search_) {
    GlobalSearchOptions how{.seed = options_.seed};
    for (const auto& m : options_.first) {
      auto& place = how.places.emplace_back();
      if (separable_)
        place = separable_->place(m);
      else
        for (const auto& p : options_.free) place.push_back(to_unit(p, get_parameter(m, p.path)));
    }
    search_.emplace(
        separable_ ? separable_->dimensions() : options_.free.size(),
        [this](std::span<const double> unit) { return look(unit); }, how);
  }
  // Where nothing is eliminated there are more dimensions to learn.
  search_->advance(separable_ ? generations_of_half : 2 * generations_of_half);
}

double GlobalStart::look(std::span<const double> unit) {
  if (options_.count) options_.count();
  auto place = at(unit);
  if (!place.model || !std::isfinite(place.squares)) return unsolvable;
  if (place.squares < squares_) {
    best_ = std::move(place.model);
    squares_ = place.squares;
    if (options_.better) options_.better(*best_, squares_);
  }
  return place.squares;
}

GlobalStart::Place GlobalStart::at(std::span<const double> unit) const {
  if (separable_) {
    auto point = separable_->at(unit, options_.fidelity);
    if (!point) return {};
    return {std::move(point->model), point->squares};
  }
  Model m = start_;
  for (std::size_t i = 0; i < unit.size(); ++i)
    set_parameter(m, options_.free[i].path, from_unit(options_.free[i], unit[i]));
  std::vector<double> r(residuals_.size());
  if (residuals_.evaluate(m, options_.fidelity, r) == Solved::no) return {};
  return {std::move(m), sum_of_squares(r)};
}

int most_simulations_of_half_a_search() {
  return GlobalSearchOptions{}.population * generations_of_half;
}

}  // namespace ferrobench::model
