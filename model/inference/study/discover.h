// Where a model and recordings of a bench disagree, what is missing in the model, and the proof on recordings
// that were not used.
//
// Residuals are counted in standard deviations of each channel's noise (excess, gap, odds). The base model's
// own parameters, and gains and offsets of the channels, are recalibrated first, within priors; what remains
// is compared with every effect of the catalogue, each refitted together with the parameters. An effect is
// named if with it nothing more is left, or if it takes most of the excess where the model's own physics is
// off; else the answer is "unknown", and terms that hold on locked recordings narrow the gap.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "model/effects/catalogue.h"
#include "model/inference/dataset/bench.h"
#include "model/inference/search/pasts.h"
#include "model/inference/selection/explanation.h"
#include "model/inference/selection/selection_options.h"
#include "model/model.h"
#include "recordings/format/recording.h"
#include "recordings/tables/published.h"

namespace ferrobench::model {

// Root mean square of the residual over noise, of one channel in one kind of segment of one recording.
struct Excess {
  std::string recording;
  recordings::Channel channel = recordings::Channel::displacement;
  std::string segment;
  double excess = 0;
};

struct Recalibration {
  double from = 0, to = 0, std = 0;
  double over_prior = 0;  // how far it went, in standard deviations of what was known beforehand
};

// What was asked and of what, so that an answer can be traced and asked for again.
struct Asked {
  struct Source {
    std::string name, title, identifier, start_time;  // of a recording; of a published table, its name
  };
  Model model;
  std::vector<Source> sources;
  std::vector<std::string> held_out, candidates;  // as the user wanted them; empty: chosen, all
  double floor = 0;
  std::uint64_t seed = 0;
  std::string time;  // ISO 8601; "": not told
};

// By channel; a channel that was not measured is absent. 1 is noise alone.
using ChannelFigures = std::map<recordings::Channel, double>;

struct Gap {
  std::vector<std::string> recordings;
  ChannelFigures before, after;
};

// What is left of a channel, root mean squares over its rows of all recordings that were learned from.
struct Left {
  double over_noise = 0;
  double of_range = 0;     // 0.01: one percent of the range
  double model_error = 0;  // standard deviation of the model's own error, over the range: what noise leaves
                           // of the line above
};

// What is left where that is material: more than DiscoverOptions::floor of a channel's range.
struct Remainder {
  Family family = Family::kinetics;  // whose functions take most of it (selection/residual_basis.h)
  recordings::Channel channel = recordings::Channel::displacement;
  std::string segment;  // in which most is left
  double of_range = 0;  // the model's error there, over the range
};

// A term that the improved model has and the base has not.
struct AddedTerm {
  EffectEstimate term;
  bool empirical = false;  // a table that was fitted and stands for what has no name
  // Of the excess that stood before it; on recordings that were learned from, and on the others. None where
  // two were found together or a table came beside what noise had named, or where nothing was locked away
  // that could show it.
  std::optional<double> share{}, share_held_out{};
  // The one whose excess is meant, of a sensor's effect that was found beside a model that is wrong by much;
  // empty: that of all. The share is then of all recordings, unless the effect could not show in those that
  // were locked away (study/incumbent.h).
  std::optional<recordings::Channel> channel{};
};

// For a picture: a segment of a recording where the gap is seen best.
struct Trace {
  std::string recording;
  recordings::Channel channel = recordings::Channel::displacement;
  std::string segment;
  bool held_out = false;
  std::vector<double> time, measured, before, after;  // SI
};

struct ChannelNoise {
  double std = 0;  // SI
  bool correlated = false;
  double correlation_time = 0;  // s, of the correlated part
};

struct Health {
  double seconds = 0;   // 0: not told
  int simulations = 0;  // of one recording, or one run of a table, each
  double numerical_error_over_noise = 0;
  int starts = 0;           // of the base model's fit
  double start_spread = 0;  // sum of squares of the best other start over that from the given model, less 1
  double largest_left = 0;  // sufficiency: the best other effect's drop of the sum of squares, once repaired
  double allowed_left = 0;
  std::map<recordings::Channel, ChannelNoise> noise;
  std::vector<std::string> warnings;
};

// A cell of a published table, with what the model gives for it before and after.
struct CellGap {
  std::string table;
  recordings::PublishedCell published;
  double before = 0, after = 0;  // in the published quantity's unit
  bool held_out = false;
};

struct Discovery {
  Asked asked;
  Verdict verdict = Verdict::nothing_missing;
  std::vector<Explanation> explanations;  // best first; "unknown" and "nothing" take the rest of 1
  double probability_unknown = 0, probability_nothing = 0;
  std::optional<Family> family;  // where something is missing
  std::vector<Excess> where;     // worst first, after the recalibration of the base model
  std::map<std::string, Recalibration> recalibrated;
  Gap train, held_out;
  // After the explanation; where something of it is material, what that is.
  std::map<recordings::Channel, Left> left;
  std::optional<Remainder> remainder;
  // Of the excess (sum of squares above that of the noise, all channels) that the base model leaves, the
  // share that the improved one takes away, 0 to 1, on recordings that were learned from and on those that
  // were not.
  double share = 0, share_held_out = 0;
  // In the order in which they were added. Where the verdict is "unknown" they narrow the gap and name
  // nothing.
  std::vector<AddedTerm> added;
  std::vector<FittedPast> pasts;  // as recorded or, where nothing was, as chosen
  std::vector<std::vector<std::string>> equivalent;
  std::vector<std::string> not_testable;
  std::map<std::string, std::map<std::string, double>> smallest_detectable;
  std::optional<NextExperiment> next_experiment;
  Model recalibrated_base;  // without any effect more
  Model improved;
  std::vector<Trace> traces;
  // If the verdict is unknown: what would have to be added to the channels, as far as that was found, and
  // effects that would explain it but are not to be believed (selection/verdict.h).
  std::vector<MissingSignal> signals;
  std::vector<EffectEstimate> doubted;
  std::vector<CellGap> cells;  // if published tables were the bench
  Health health;
};

struct DiscoverProgress {
  std::string stage;
  double fraction = 0;  // of the whole
};

struct DiscoverOptions {
  std::vector<std::string> held_out{};  // names; empty: chosen
  // Effects that may be named; empty: the whole catalogue, and for tables what of it is not the drive's or a
  // sensor's.
  std::vector<std::string> candidates{};
  // What is left counts as material above this share of a channel's range.
  double floor = 0.002;
  std::uint64_t seed = 1;
  int threads = 0;  // 0: as many as the machine has
  inference::SelectionOptions selection{};
  // Called now and then; false stops with Error(cancelled).
  std::function<bool(const DiscoverProgress&)> progress{};
  // Asked all the time, from several threads; true stops with Error(cancelled) at once, whatever goes on.
  std::function<bool()> stop{};
};

// Throws Error(bad_recording) that names the recording if one cannot be used, Error(invalid_params) for
// unknown names of held-out recordings or candidates.
Discovery discover(const Model& base, std::vector<NamedRecording> recordings,
                   const DiscoverOptions& options = {});

// The same with published tables (recordings/tables) for a bench: "recordings" are the runs behind them, by
// the first key of their cells ("8 MPa", "50 V/s"); of three or more the middle one is locked away unless
// said otherwise. Residuals are logarithms of cells over how well these are known
// (residuals/whitened_tables.h).
Discovery discover_in_tables(const Model& base, const std::vector<std::string>& tables,
                             const DiscoverOptions& options = {});

}  // namespace ferrobench::model
