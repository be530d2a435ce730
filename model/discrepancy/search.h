// The search itself, from residuals to a judged explanation: recalibration, naming, verdict. What the
// residuals are of, recordings or published tables, is the misfit's business.
#pragma once

#include <span>

#include "model/discrepancy/discover.h"
#include "model/discrepancy/verdict.h"

namespace ferrobench::model::discrepancy {

// What both kinds of bench, recordings and tables, take from the options, which must outlive it.
int threads_of(const DiscoverOptions& options);
SimulationOptions stoppable(SimulationOptions simulation, const DiscoverOptions& options);
// Reports progress; throws Error(cancelled) if that is wanted. `options` must outlive it.
using Ticker = std::function<void(const std::string& stage, double fraction)>;
Ticker ticker(const DiscoverOptions& options);
// Throws Error(invalid_params) unless all of `wanted` are among `names`, and not all of these.
void check_held_out(const std::vector<std::string>& wanted, const std::vector<std::string>& names);

// Effects that may be named: those of the catalogue (of `wanted` if there are any) that the model has not
// got and that mean something for it.
std::vector<const Effect*> candidates_of(const Model& model, const std::vector<std::string>& wanted);

// Makes `fine` fine enough for the base model, and `usual` the cheapest whose own error is below the noise.
void choose_simulations(Misfit& usual, Misfit& fine, const Hypothesis& base, int most_domains,
                        Health& health);

struct SearchOptions {
  std::vector<const Effect*> candidates;
  std::uint64_t seed = 1;
  double small_against = 0;  // a share of what is explained: so well are model and measurement known
  bool few = false;          // numbers: they cannot tell two effects, and many starts fit them by chance
  int most_domains = 0;      // of the fine simulation
  // Called once the base model stands roughly; changes the residuals.
  std::function<void(const Fit&)> roughly_fitted;
  // What functions of the signals would still take off the sum of squares; absent: not asked.
  std::function<double(const Fit&)> beyond_effects;
  Ticker tick;
};

struct Search {
  Fit base;  // recalibrated
  NamingOptions options;
  Naming naming;
  Judgement judgement;
  double samples = 0;
  const Trial* best = nullptr;  // what is added to the model, if anything

  const Fit& after() const { return best != nullptr ? best->fit : base; }
};

// `misfit` by the simulation that was chosen, `fine` the same by the fine one, which is refined where an
// explanation wants that.
Search search(const Misfit& misfit, Misfit& fine, const Hypothesis& base, const SearchOptions& options,
              Health& health);

// What the search says of effects, parameters and models.
void tell(const Search& search, Discovery& out);

}  // namespace ferrobench::model::discrepancy
