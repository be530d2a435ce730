// The minimum of a function over the unit cube by the covariance matrix adaptation evolution strategy (N.
// Hansen, arXiv:1604.00772), which learns the valley's directions as it goes. How often it and others found
// the deepest valley of a ceramic's loops stands in the folder's README, section 9.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

namespace ferrobench::model {

struct GlobalSearchOptions {
  int population = 20;      // of a generation; about 4 + 3 ln(dimensions) is the literature's least
  double step = 0.3;        // first standard deviation: the cube's own is 0.29
  double tolerance = 1e-3;  // ends once a generation's values are no further apart than this
  std::uint64_t seed = 1;
  std::vector<std::vector<double>> places{};  // in the first generation, beside places drawn evenly
};

struct GlobalMinimum {
  std::vector<double> at;
  double value = 0;
  int evaluations = 0;
};

class GlobalSearch {
 public:
  // Evaluates the first generation, whose best is where the others begin. `objective` may throw, which ends
  // the search.
  GlobalSearch(std::size_t dimensions, std::function<double(std::span<const double>)> objective,
               const GlobalSearchOptions& options);
  ~GlobalSearch();
  GlobalSearch(const GlobalSearch&) = delete;
  GlobalSearch& operator=(const GlobalSearch&) = delete;

  // So many generations more, at most; what was learned by those before is kept.
  void advance(int generations);
  // Of the present generation.
  GlobalMinimum best() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace ferrobench::model
