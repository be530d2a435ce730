// What a fit compares: the residuals of a model, simulated minus measured, as a vector in one scale.
//
// Residual models are immutable. How finely is simulated is an argument of every call, so that one object
// serves a coarse search and a fine solution at the same time, from several threads.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "model/inference/dataset/recording_data.h"
#include "model/inference/parameters/parameters.h"
#include "model/model.h"
#include "model/simulator.h"
#include "recordings/format/recording.h"
#include "recordings/tables/comparison.h"

namespace ferrobench::model {

struct Fidelity {
  SimulationOptions simulation;
  // For a search: recordings are driven by RecordingData::simplified, which saves steps where the drive is a
  // measured field with a knot at every sample, and a table's run may take fewer steps.
  bool coarse = false;
};

// Whether a model could be simulated at the values asked for. A search turns back where it could not.
enum class Solved { yes, no };

// Residuals of one measured quantity: the rows first .. first + count. Of a recording they are percent of the
// range, their errors have a standard deviation that is not known and go together in time; of a table they
// are counted in standard deviations and are independent.
struct ResidualPart {
  std::string name;  // "loops, displacement"
  std::size_t first = 0, count = 0;
  bool in_standard_deviations = false;
};

double sum_of_squares(std::span<const double> r);

// A measured quantity beside what a model gives for it, whose offset is eliminated. SI; all equally long.
struct ComparedCurve {
  std::string recording;
  recordings::Channel channel = recordings::Channel::displacement;
  std::vector<double> time, field, measured, simulated;
};

// A problem in which some parameters enter linearly, once the kinetics are known (residuals/separable.h).
class Separable;

class ResidualModel {
 public:
  virtual ~ResidualModel() = default;
  std::size_t size() const { return size_; }
  const std::vector<ResidualPart>& parts() const { return parts_; }
  // Fills `out`, size() long; it is undefined after Solved::no. Throws Error(cancelled) if the simulation is
  // stopped.
  Solved evaluate(const Model& model, const Fidelity& fidelity, std::span<double> out) const;
  // The same with d residual / d value of `by`, a row for each residual. Solved::no also where only slopes
  // are not to be had.
  Solved evaluate_with_slopes(const Model& model, const Fidelity& fidelity,
                              const std::vector<FreeParameter>& by, std::span<double> out,
                              Eigen::MatrixXd& slopes) const;
  // Names with the root mean square of what was compared: percent of the range, or of the logarithm of a
  // cell's ratio.
  virtual std::vector<std::pair<std::string, double>> summary(const Model& model,
                                                              const Fidelity& fidelity) const = 0;
  // For pictures, of recordings: every part with its rows. Throws Error(numerical) if the model cannot be
  // simulated.
  virtual std::vector<ComparedCurve> curves(const Model&, const Fidelity&) const { return {}; }
  // What was given and says nothing, a sentence each: "loops, force never changes".
  virtual std::vector<std::string> unused() const { return {}; }
  // The recordings behind it, if it is of recordings: where a search looks for a start.
  virtual std::span<const RecordingData> recordings() const { return {}; }
  // The same with other pasts, one for each of the recordings. Null if it is not of recordings.
  virtual std::unique_ptr<ResidualModel> with_pasts(std::span<const protocols::Past>) const {
    return nullptr;
  }
  // Null where no parameter enters linearly. What it gives refers to this object.
  virtual std::unique_ptr<Separable> separable(const Model&, const std::vector<FreeParameter>&) const;

 protected:
  // Both of these; `slopes` is null where none are wanted, else residuals x `by`, filled with zeros. What is
  // not finite counts as not solved.
  virtual Solved fill(const Model& model, const Fidelity& fidelity, const std::vector<FreeParameter>& by,
                      std::span<double> out, Eigen::MatrixXd* slopes) const = 0;
  std::size_t size_ = 0;
  std::vector<ResidualPart> parts_;
};

// Recordings: charge, displacement and force where they were measured, each in percent of its range, such
// that the root of the sum of squares of a channel is its root mean square. A sensor's zero is unknown: an
// offset of each channel of each recording is a nuisance parameter, and is eliminated by its least-squares
// estimate, the mean. Each recording is simulated with its own load and specimen, under its command (its
// field if there is none).
std::unique_ptr<ResidualModel> recording_residuals(std::vector<recordings::Recording> recordings);
std::unique_ptr<ResidualModel> recording_residuals(std::vector<RecordingData> recordings);

// Published tables, fitted together: the logarithm of each cell's ratio over how well the cell is known, and
// that creep changes with the prestress in the direction that was published. `parameters` override those of
// the protocols (for example rate).
std::unique_ptr<ResidualModel> table_residuals(const std::vector<std::string>& tables,
                                               const std::map<std::string, double>& parameters = {});
// The comparison that the residuals are made of, for a look at the cells.
recordings::Comparison simulate_table(const Model& model, const std::string& table,
                                      const SimulationOptions& options,
                                      const std::map<std::string, double>& parameters = {});

}  // namespace ferrobench::model
