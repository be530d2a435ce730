// The observer that takes derivatives along with a simulation (sensitivities.h).
#pragma once

#include "model/physics/ensemble_tangents.h"
#include "model/physics/parametrized.h"
#include "model/sensitivities.h"
#include "model/simulator_state.h"

namespace ferrobench::model {

// The model with tangents: parameters[i] moves in direction i.
ModelOf<DualNumber> with_tangents(const Model& model, std::span<const std::string> parameters);

class ForwardSensitivities final : public StepObserver {
 public:
  // `state` is that of the simulation, made from `model`, and must outlive this, as must what `drive` refers
  // to.
  ForwardSensitivities(Simulator::State& state, const Model& model, std::span<const std::string> parameters,
                       const SlopeSpans& out, const DriveDirections& drive = {});

  // Rows that are asked for next follow those that are done.
  void begin(std::size_t done) { first_row_ = done; }

  void start(double field, const Fractions& fractions, double time) override;
  void begin_recording() override;
  void play(const FieldPiece& command, std::size_t pieces) override;
  void solved(const SolvedStep& step) override;
  void sense_at(double time, std::size_t row) override;
  void sense_within(double share) override;
  void accepted() override;

 private:
  using Number = DualNumber;
  using LoadTangents = std::array<std::array<double, parameter_directions>, 3>;

  // As many parameters as one number carries.
  struct Part {
    explicit Part(ModelOf<Number> model) : around(std::move(model)) {}
    Surroundings<Number> around;
    std::optional<ParametrizedLaw<Number>> law;
    std::size_t first = 0, count = 0;  // of the parameters and directions of the drive
    Number command = 0;                // V/m, at the last knot
    std::vector<FieldPieceOf<Number>> pieces;
    Trial<Number> trial;
    LoadsOf<Number> at, at_before;  // that the kinetics see
    Number bend = 0;                // Pa
    Number polarization = 0, polarization_before = 0;
    Number piece_start = 0;  // s
  };

  Number knot(const Part& part, double value, std::span<const double> slopes, std::size_t index) const;
  static void begin_trial(Part& part, const SolvedStep& step, double done);
  static Causes causes_of(const Part& part, std::size_t direction);
  void take_means(Part& part, const Means& means);
  static LoadTangents end_trial(Part& part);
  void put(Part& part, const Sensed<Number>& seen, std::size_t row);

  Simulator::State& state_;
  DriveDirections drive_;
  std::size_t parameters_;       // and directions of the drive, which follow them
  std::size_t first_direction_;  // the first of these
  SlopeSpans out_;
  std::size_t knot_ = 0;  // that has been reached
  bool in_past_ = false;  // which the drive's directions do not move
  std::vector<std::unique_ptr<Part>> parts_;
  std::optional<EnsembleTangents> domains_;
  std::vector<Causes> causes_;
  std::vector<MeanTangents> means_;
  std::size_t first_row_ = 0, piece_ = 0;
  double done_ = 0;       // share of the piece
  bool coupled_ = false;  // any part
  bool stepping_ = false, last_ = false;
};

}  // namespace ferrobench::model
