// The inside of the simulator, for those who look on: forward sensitivities and the recording of step plans.
#pragma once

#include "model/physics/coupling.h"
#include "model/physics/ensemble.h"
#include "model/simulator.h"
#include "model/step_plan.h"
#include "model/surroundings.h"

namespace ferrobench::model {

// A step that is about to be accepted.
struct SolvedStep {
  const Trial<double>& trial;
  Loads at, bend;     // as the kinetics have seen them
  double share = 0;   // of the duration of its piece
  bool last = false;  // of the piece
  std::size_t piece = 0;
};

// Told of all that a run does, in order: start, then play, then in each step solved, sense (several times or
// never) and accepted; between two plays begin_recording, where a past ends.
class StepObserver {
 public:
  virtual ~StepObserver() = default;
  virtual void start(double field, const Fractions& fractions, double time) = 0;
  virtual void begin_recording() = 0;
  virtual void play(const FieldPiece& command, std::size_t pieces) = 0;
  virtual void solved(const SolvedStep& step) = 0;
  // At `time`, one that was asked for and goes to `row` of the piece's output, or at a share of the step that
  // only the sensors see.
  virtual void sense_at(double time, std::size_t row) = 0;
  virtual void sense_within(double share) = 0;
  virtual void accepted() = 0;
};

// Sees the same specimen through sensors of its own.
struct Onlooker {
  Ports ports;
  ChannelSpans out;
};

struct Simulator::State : Surroundings<double> {
  State(Model given, const SimulationOptions& given_options, const StepPlan* plan = nullptr);

  SimulationOptions options;
  std::unique_ptr<Kinetics> kinetics;
  Ensemble* ensemble = nullptr;  // kinetics, if that is what they are
  Lattice lattice;
  Coupling coupling;
  Loads at, bent;  // of the last evaluation of the kinetics
  double command = 0;
  double next_step = 0;
  std::size_t sensed = 0;  // outputs done in this call
  SimulationStatistics statistics;
  double squared_error = 0;
  StepObserver* observer = nullptr;
  std::vector<Onlooker> onlookers;
  std::size_t first_row = 0;  // of the onlookers' output, in this call
  const StepPlan* followed = nullptr;
  std::size_t planned = 0;  // steps done of `followed`
  int cycles = 0;           // played of a past that is the program itself

  // Time 0 or, for a past that is still to be played, before it.
  void start(double field, const Fractions& fractions = {}, double time = 0);
  SpreadShape spread_shape() const;  // of the domains
  // What was played so far is the past: time 0 is now.
  void begin_recording();
  void play(double duration, double field, std::span<const double> times, const ChannelSpans& out);

 private:
  double path_rate(double slew) const;
  // `stuck`: shorter steps have not helped.
  bool solve(Trial<double>& trial, bool stuck = false);
  double defect(const Trial<double>& trial) const;
  struct WellEnds {
    double sharpness = 0;  // c, 1/s
    double reached = 0;    // share of the domains
  };
  WellEnds well_ends(double path) const;
  double growth(const Trial<double>& trial) const;
  double step_error(const Trial<double>& trial, const WellEnds& ends) const;
  void accept_step(Trial<double>& trial, const std::vector<std::size_t>* slept);
  void begin_to_look_on();
  void output(const Trial<double>& trial, double since, std::size_t row, const ChannelSpans* out);
  void sense_step(const Trial<double>& trial, std::span<const double> times, const ChannelSpans& out,
                  double piece_end);
  void play_piece(const FieldPiece& piece, std::size_t index, std::span<const double> times,
                  const ChannelSpans& out);
  void follow_piece(const FieldPiece& piece, std::size_t index, std::span<const double> times,
                    const ChannelSpans& out);
  void take(Trial<double>& trial, const SolvedStep& step, std::span<const double> times,
            const ChannelSpans& out, double piece_end);
};

// Plays a field that is linear between its knots, after the past of the state's options; before each piece of
// it begin(number of times that are done).
void play_knots(Simulator::State& state, std::span<const double> knot_time,
                std::span<const double> knot_field, std::span<const double> times, const ChannelSpans& out,
                const std::function<void(std::size_t)>& begin = {});

}  // namespace ferrobench::model
