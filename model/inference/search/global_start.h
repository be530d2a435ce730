// Where a fit may begin, found in the whole range of every free parameter by a global search
// (search/global_search.h). Parameters that enter linearly are eliminated where there are such
// (residuals/separable.h); where there are none, the search takes twice as many generations.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "model/inference/residuals/residual_model.h"
#include "model/inference/residuals/separable.h"
#include "model/inference/search/global_search.h"

namespace ferrobench::model {

struct GlobalStartOptions {
  std::vector<FreeParameter> free;
  Fidelity fidelity;         // of every simulation: a coarse one
  std::vector<Model> first;  // that take part in the first generation
  std::uint64_t seed = 1;
  std::function<void()> count{};  // called before every simulation; may throw, which ends the search
  // Called with what is the best so far, and its sum of squares.
  std::function<void(const Model& model, double squares)> better{};
};

class GlobalStart {
 public:
  // `start` gives what is not free. It and `residuals` outlive the search.
  GlobalStart(const Model& start, const ResidualModel& residuals, GlobalStartOptions options);
  // The search that it holds calls it where it is.
  GlobalStart(const GlobalStart&) = delete;
  GlobalStart& operator=(const GlobalStart&) = delete;

  // The first half of the search's generations, and the second. Where a search stands after the first tells
  // something of where it ends: of ten with 200 generations on the loops of a ceramic, the five best after
  // half of them held the two best of the end. So the worse of several searches are left there.
  void advance();
  // The best that was found; empty if none could be simulated.
  const std::optional<Model>& best() const { return best_; }
  double squares() const { return squares_; }  // its sum; infinite if there is none

 private:
  // A model in the unit cube of the parameters that are searched, with its sum of squares.
  struct Place {
    std::optional<Model> model;
    double squares;
  };
  Place at(std::span<const double> unit) const;
  double look(std::span<const double> unit);

  const Model& start_;
  const ResidualModel& residuals_;
  GlobalStartOptions options_;
  std::unique_ptr<const Separable> separable_;  // null: nothing is eliminated
  std::optional<GlobalSearch> search_;          // once begun
  std::optional<Model> best_;
  double squares_ = std::numeric_limits<double>::infinity();
};

// That a call of advance() makes at most where parameters are eliminated; twice as many where none is.
int most_simulations_of_half_a_search();

}  // namespace ferrobench::model
