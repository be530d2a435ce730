// Forward sensitivities of an ensemble: tangents of every domain's fractions in several directions, which
// follow the rows as these wake and fall asleep.
//
// Directions are those of the parameters, followed by three for the loads at the step's end: field, stress
// and bend. These begin each step at zero; once it is known how the loads depend on the parameters, settle()
// adds them up.
#pragma once

#include "model/physics/ensemble.h"
#include "model/physics/kernel_tangents.h"

namespace ferrobench::model {

class EnsembleTangents {
 public:
  EnsembleTangents(SpreadSlopes domains, std::size_t parameters);

  // Fractions that no parameter moves; `change` is what has fallen asleep there.
  void start(const InactiveSetChange& change);
  void wake(const std::vector<std::size_t>& rows);
  // Takes the tangents along in the step that the ensemble has proposed. `causes` and `out` have an entry for
  // each direction; rates in `out` are times tau.
  void step(const Ensemble::Proposal& proposal, const std::vector<Causes>& causes,
            std::vector<MeanTangents>& out);
  // loads[k][p]: d(field, stress, bend)/d(parameter p).
  void settle(const std::array<std::vector<double>, 3>& loads);
  void put_to_sleep(const std::vector<std::size_t>& rows);

 private:
  struct Direction {
    std::vector<double> plus, minus;
    double asleep_plus = 0, asleep_minus = 0;
    bool moves = false;  // has ever been other than zero
  };
  void swap_rows(std::size_t i, std::size_t j);
  static void clear(Direction& direction);

  std::size_t parameters_, size_;
  std::vector<Direction> directions_;
  SpreadSlopes given_, rows_;  // in the order in which they were given, and as the rows are now
  std::size_t awake_ = 0;
};

}  // namespace ferrobench::model
