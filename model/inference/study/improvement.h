// Improves a model that misses the recordings by more than noise. One or two effects are named if each takes
// a material share of the excess that stood before it, on the training and on the held-out recordings. If
// none does, one effect with which the model is no longer wrong by much may be added without being named; the
// caller then selects effects again with noise as the only error. If there is no such effect either, the gap
// is narrowed all the same: terms are added to the base, each of which must make the model likelier and must
// hold on the held-out recordings, whether its cause is known or not. What named effects leave is narrowed by
// empirical terms alone.
//
// If a model is wrong by much, its own error is part of the likelihood (observation/noise.h) and is estimated
// again after every term. If it is wrong by little, noise is the only error: with a model error that is
// correlated over many rows the priors would outweigh the measurements.
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
// switching between both 180-degree wells, barriers that differ by polarity, spreads of another shape). Then
// come empirical tables (model/effects/empirical.h) at the port where they gain most; their weights have a
// normal prior, whose width, and the time constant of their memory, are those of the largest marginal
// likelihood (Laplace's approximation, around the model as it stands).
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
  const WhitenedRecordings* noise_only = nullptr;
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
  // Whether all recordings without a recorded past are taken to have been poled towards +, and no fit spoke
  // against that. In a model that does not switch no fit could; a table added to it may depend on the past.
  bool presumed_past = true;
  // Whether to stop once effects were added with which the model is no longer wrong by much. The caller then
  // selects effects with noise as the only error, and has the rest narrowed only if that selects none.
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
  std::vector<AddedTerm> added;     // with 90 % intervals
  bool named = false;               // whether the effects among `added` are named
  bool for_noise_to_judge = false;  // whether it stopped early, as task.until_noise_may_judge asks
  bool searched = false;            // the base's parameters are those of a search of their whole range
  // If effects were named here: those that were tried as the last of them, which is in the list, with their
  // probabilities given that it is one of these; most probable first.
  std::vector<std::pair<const Effect*, double>> rivals;
};

// Improves the model that `base` holds. If task.noise_only is set, `base` must be a converged fit; otherwise
// only its hypothesis and z are used. If a simulation fails, adds a warning and returns nothing.
std::optional<Improvement> improve(const Fit& base, const ImprovementTask& task,
                                   std::vector<std::string>& warnings);

}  // namespace ferrobench::model::inference
