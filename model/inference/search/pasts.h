// What a specimen had been through before a recording whose past nobody wrote down: the likeliest of
//
//   poled towards +, poled towards -, unpoled
//   cycled: the program itself until it repeats, from each of these, or from a specimen partly poled; the
//   degree is a free number
//   visited: from the far side, or unpoled, to one extreme level and back, at the recording's own pace; the
//   level is a free number
//
// by -2 ln L = n ln(sum of squares) + k ln(n), with k free numbers and n rows that are independent of each
// other (what a model misses goes together over many samples). A free level has to halve the sum of squares,
// n ln 2 more: where a model is wrong, a level that nobody set makes up for it. A degree of poling has not:
// each specimen has one, and cycles that do not saturate it leave much of it.
//
// Tables of one file state each other's past (dataset/succession.h), but for the state before the first of
// them and whether each was cycled before: those are taken under which all of them are likeliest together.
// Such a past is presumed, and stands unless it leaves much where another one leaves less than half of its
// sum of squares: a past that is free makes up for what the model misses, and one that was measured does not.
//
// Near a start neither the polarization nor the strain is right yet, so the height of each channel is free;
// the coercive fields and which way the first ramp goes tell the pasts apart all the same.
#pragma once

#include <Eigen/Dense>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "model/inference/dataset/recording_data.h"
#include "model/inference/residuals/residual_model.h"

namespace ferrobench::model {

struct FittedPast {
  std::string recording;  // its title, or the name that it was given by
  protocols::Past past;
  bool chosen = false;  // as the likeliest; else the recording says so itself
};

// What a past leaves of one recording.
struct PastMisfit {
  double squares = std::numeric_limits<double>::infinity();  // infinite: it cannot be simulated
  double independent = 1;                                    // rows
};

struct PastSearch {
  std::function<PastMisfit(const protocols::Past&)> misfit;
  bool degrees = true;        // a specimen may have been partly poled before it was cycled
  bool cycled_alone = false;  // no other kind
  double not_seen = 0;        // of the sum of squares: a smaller one is no likelier
  // What -2 ln L has to fall by for a free level, beyond what its number costs; empty: n ln 2, see above.
  std::optional<double> level_gain{};
  double enough = 0;  // A past with a name that leaves no more than this is taken.
  // The likeliest of these is taken, unless another past leaves less than half as much of the sum of squares
  // and they leave more than `not_doubted`.
  std::vector<protocols::Past> presumed{};
  double not_doubted = 0;
  // The residual whose sum of squares `misfit` states. Where it is given, the time in which a level was gone
  // to is free as well; else it is that of the recording's own pace.
  std::function<Eigen::VectorXd(const protocols::Past&)> residual{};
};

struct FoundPast {
  protocols::Past past;
  PastMisfit misfit;
};

// The likeliest past of a recording that was driven by this field (V/m, linear between times in s); none
// where no past can be simulated.
std::optional<FoundPast> likeliest_past(std::span<const double> time, std::span<const double> field,
                                        const PastSearch& how);

// A visit's level and time from where they stand; `how` has a residual.
FoundPast refined_past(std::span<const double> field, const protocols::Past& visit, const PastSearch& how);

struct PastChoice {
  Fidelity fidelity;
  bool heights_are_free = false;  // then what was measured before is not doubted
  bool cycled_alone = false;      // no other kind
  // Taken for all that follow no other, unless it leaves much of one of these where another past leaves less
  // than half as much of the sum of squares: the model may be wrong in more than the past.
  std::optional<protocols::Past> presumed{};
  std::function<void()> count{};  // before each simulation, from several threads; may throw
};

// One for each recording: as it is recorded, else the likeliest under any of the models; what it was before
// where none of the models can be simulated.
std::vector<protocols::Past> choose_pasts(std::span<const Model> models, std::span<const RecordingData> data,
                                          const PastChoice& choice);
// Of one recording, whatever others say of its past: another one than it follows from tables before it is
// judged with numbers that were fitted beside it. None where none of the models can be simulated.
std::optional<protocols::Past> choose_past_alone(std::span<const Model> models, const RecordingData& data,
                                                 const PastChoice& choice);
// The share of what a presumed past leaves of its recording that another one may leave to be believed.
inline constexpr double most_left_by_another_past = 0.5;

}  // namespace ferrobench::model
