// A discovery in recordings under way (study/discover.h): what it was asked, the bench, how this is split,
// and what has been found so far.
#pragma once

#include <atomic>
#include <vector>

#include "model/inference/study/improvement.h"
#include "model/inference/study/unknown_pasts.h"
#include "model/inference/study/workflow.h"

namespace ferrobench::model::inference {

struct Session {
  explicit Session(const DiscoverOptions& given) : options(given) {}
  const DiscoverOptions& options;
  Ticker tick = ticker(options);
  int threads = threads_of(options);
  std::atomic<std::uint64_t> simulations = 0;
  Discovery out;
  bool presumed_past = true;        // of all that name none
  Eigen::VectorXd start;            // of the recalibration, where pasts were settled on; else empty
  std::vector<RecordingData> data;  // as a choice of pasts sees the recordings
  std::vector<BenchRecording> bench;
  std::vector<std::vector<NoiseModel>> noise;
  std::vector<std::size_t> train, held_out;
  SelectionOptions selection;  // the options', raised to what simulations resolve of what is learned from
  // What may be named, and what may stand for the rest: corrections of the kinetics, and tables.
  std::vector<const Effect*> candidates, corrections, tables;

  SimulationOptions watched(SimulationOptions simulation) {
    return inference::watched(simulation, options, simulations);
  }
};

// Takes out what these recordings can say nothing of.
void drop_untestable(Session& s);

// Gives each recording that names no past the likeliest under the model as it is given.
void choose_unknown_pasts(const Model& base, std::vector<NamedRecording>& recordings, Session& s);
// What was chosen under the given model may have been wrong as that model was.
void settle_unknown_pasts(const Model& base, Session& s);
UnknownPasts unknown_pasts(Session& s);
// Puts the bench's pasts into what was found.
void tell_pasts(Session& s);

// As the user wants it, or about a quarter.
std::vector<bool> held_out_by(const Session& s);
void split(Session& s, const std::vector<bool>& held);

// What narrowing a gap needs to know of this bench, but for whom it tells of its progress.
ImprovementTask improvement_task(Session& s, const SimulationOptions& fine);
// A model that is wrong by much may have misled the choice of pasts, and be far from its best parameters.
void allow_far_search(Session& s, ImprovementTask& task);

}  // namespace ferrobench::model::inference
