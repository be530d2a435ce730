// Where a fit and the recordings disagree, and by how much, as a laboratory would look at it: residuals in
// standard deviations of the noise, not whitened, with offsets taken out.
#pragma once

#include <set>
#include <span>
#include <vector>

#include "model/inference/residuals/whitened_recordings.h"
#include "model/inference/selection/selection_options.h"
#include "model/inference/solver/gauss_newton.h"
#include "model/inference/study/discover.h"

namespace ferrobench::model::inference {

// By recording (in the order of residuals.chosen()), channel and row.
using Signals = std::vector<std::vector<std::vector<double>>>;
struct Prediction {
  Signals simulated;     // SI
  Signals standardized;  // measured less simulated, over noise; NaN where not measured
};
// By the fine simulation. Drives that were read from a measured field are put where the channels want them,
// as far as the field's noise allows; the coarse residuals of the same recordings make the slopes for that.
Prediction predict(const WhitenedRecordings& fine, const WhitenedRecordings& coarse,
                   const Hypothesis& hypothesis, const Eigen::VectorXd& z);
// With drives as they were read: a model that misses by many times the noise would want them anywhere.
Prediction predict(const WhitenedRecordings& fine, const Hypothesis& hypothesis, const Eigen::VectorXd& z);

ChannelFigures rms_by_channel(const WhitenedRecordings& residuals, const Signals& standardized);
// Recordings (indices in the bench) with a channel that shows lack of fit.
std::set<std::size_t> unexplained(const WhitenedRecordings& residuals, const Signals& standardized,
                                  const SelectionOptions& options);
std::map<recordings::Channel, Left> left_by_channel(const WhitenedRecordings& residuals,
                                                    const Signals& standardized);
std::map<recordings::Channel, Left> left_at(const WhitenedRecordings& residuals, const Hypothesis& hypothesis,
                                            const Eigen::VectorXd& z);
// Whether the model is so far off that its own error, and not noise, is what effects have to be told from: in
// a channel more than ten times the noise and 2 % of the range. Of twelve benches of the campaign whose
// physics is the model's recalibration left at most 5.1 times the noise; one large effect can leave more.
bool is_gross(const WhitenedRecordings& residuals, const Hypothesis& hypothesis, const Eigen::VectorXd& z);
// Whether the model's own error is more than this share of a channel's range anywhere.
bool is_material(const WhitenedRecordings& residuals, const Hypothesis& hypothesis, const Eigen::VectorXd& z,
                 double floor);
// Over the rows that were measured; 0 where none was.
double mean_square(std::span<const double> standardized);
// The sum of squares above the noise's, of one channel of one recording; none where noise is enough. Each
// channel is asked for itself: a noise that was counted too high in one must not hide what is missed in
// another.
double excess_squares(std::span<const double> standardized);
double excess_squares(const Signals& standardized);
// Whether more than noise is in any channel.
bool shows(const Signals& standardized, const SelectionOptions& options);
// The share of the excess before that is gone after, 0 to 1; 0 where there was none.
double share_explained(const Signals& before, const Signals& after);
// By recording, channel and class of segment; worst first.
std::vector<Excess> excess_by_segment_class(const WhitenedRecordings& residuals, const Signals& standardized);

// Where most is left in the channel whose model error is largest over its range, if that is more than
// `floor`; without the family. `where` is sorted, worst first.
std::optional<Remainder> remainder_of(const std::map<recordings::Channel, Left>& left,
                                      const std::vector<Excess>& where, double floor);

// The segments in which an explanation took away most or, where nothing was added, in which most is left; at
// most `count`, one for each channel and recording.
std::vector<Trace> traces(const WhitenedRecordings& residuals, const Prediction& before,
                          const Prediction& after, std::size_t count, bool held_out);

}  // namespace ferrobench::model::inference
