// A model that is wrong by more than noise. One or two effects are named if each takes a material share of
// what stands before it, on recordings that were learned from and on those that were locked away. Where there
// is none, the first beside which the model is no longer wrong by much is added without being named, and is
// left for noise to judge; where there is none of these either, the gap is narrowed all the same: the base
// model gets terms, each of which must make it likelier and must hold on the locked recordings, however
// little is known of why. What named effects leave is narrowed by data-driven terms alone.
//
// A model that is wrong by much stays so, and its own error is part of the likelihood (observation/noise.h),
// estimated again after every term. One that is wrong by little is fitted by noise alone: beside an error
// that goes together over many rows what is known beforehand would count for more than what was measured.
// With s_k the sum of squares that a model with k more numbers leaves of n independent rows, a term has to
// earn
//
//   n ln(s_0 / s_k) - k ln(n) > least_gain
//
// Where no effect does, the whole range of the base's parameters is searched again, alone and beside each
// effect of the kinetics (study/base_search.h), and the best of these is treated like an effect that was
// found.
//
// Effects of the catalogue come first, beside them corrections of the kinetics that name nothing (direct
// switching between both 180-degree wells, barriers that differ by polarity, spreads of another shape), then
// data-driven terms
// (model/effects/empirical.h) at the port where they gain most; the weights of these have a normal prior,
// whose width, and the time constant of their memory, are those of the largest marginal likelihood (Laplace's
// approximation, around the model as it stands).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "model/inference/study/base_search.h"
#include "model/inference/study/validation.h"

namespace ferrobench::model::inference {

struct ImprovementTask {
  const std::vector<BenchRecording>* bench = nullptr;
  const std::vector<std::vector<NoiseModel>>* noise = nullptr;
  std::vector<std::size_t> train, held_out;
  // What may be added: effects, and of the empirical terms those that correct the kinetics, and tables.
  std::vector<const Effect*> candidates, corrections, tables;
  // Effects that the base has been given and that are named already; empty: none, they are looked for.
  std::vector<AddedTerm> named{};
  SimulationOptions simulation;  // the fine one; what stops it is used in all
  int threads = 1;
  SelectionOptions selection;  // its material_share and lack_of_fit
  // Of the range: tables do not work on an error below this, and effects and corrections do only where noise
  // alone is the measure and has found something.
  double floor = 0;
  // Residuals of `train` by noise alone, where that is the measure still. Null where the model is wrong by
  // much, or where what `named` leaves is to be narrowed: it is fitted beside its own error then, and
  // gains and offsets are taken for what the instruments state while terms are looked for. Nobody could tell
  // that they are off, and the model is handed on without them.
  const WhitenedRecordings* by_noise = nullptr;
  // The pasts that are likeliest under a recalibrated model, in the bench's order, and what puts pasts into
  // the bench. Null: none is to be chosen.
  std::function<std::vector<protocols::Past>(const Model&)> choose_pasts{};
  std::function<void(const std::vector<protocols::Past>&)> set_pasts{};
  // Searches the whole range of a base model's parameters again (study/base_search.h), alone and beside
  // effects, where misses count by these errors. Null: that is not done.
  std::function<std::vector<SearchedBase>(const Model&, const std::vector<const Effect*>& beside,
                                          const std::vector<std::vector<NoiseModel>>& errors,
                                          const SearchTick&)>
      search_bases{};
  // Poled towards + has been presumed of all that name no past, and nothing has spoken against it. A model
  // that does not switch feels no past, so there a table may.
  bool presumed_past = true;
  // Whether it ends as soon as effects are named beside which the model is not wrong by much: noise can judge
  // these then, and what is left is narrowed only if it does not find them.
  bool until_noise_may_judge = false;
  // Whether tables are added where corrections of the kinetics were; else these end it.
  bool tables_beside_corrections = true;
  std::function<void(const std::string& stage, double fraction)> tick{};
};

struct Improvement {
  Fit base;                                    // without any term, recalibrated beside the model's own error
  std::vector<protocols::Past> pasts_of_base;  // of the bench, that the base was fitted under
  Hypothesis hypothesis;
  Eigen::VectorXd z;
  std::vector<AddedTerm> added;  // with 90 % intervals
  // Whether the terms are named, and then: effects that were tried in the place of the last one, itself among
  // them, with their probabilities if it is one of these, most probable first.
  bool named = false;
  bool for_noise_to_judge = false;  // it ended where the task said so
  bool searched = false;            // the base's parameters are those of a search of their whole range
  std::vector<std::pair<const Effect*, double>> rivals;
};

// From where a base model stands. By noise alone it has to be a fit to the end; else hypothesis and z do.
// None, and a warning, where a simulation fails on the way: what was found before stands.
std::optional<Improvement> improve(const Fit& base, const ImprovementTask& task,
                                   std::vector<std::string>& warnings);

}  // namespace ferrobench::model::inference
