// The polycrystal by parametrization (4.59-4.65): one representative domain between the + and the 90 well,
// whose critical driving force is a table of the phase fraction, one branch for each direction.
//
//   + -> 90 has no barrier left where F_{+,90} reaches F_unload(x+), 90 -> + where it falls to F_load(x+).
//   The internal driving force that moves them there is added to the applied one (4.62), so the barriers are
//
//   dg_{+,90} = dg(F_{+,90} + 4 dg0 - F_unload(x+)),   dg_{90,+} = dg(-F_{+,90} + 4 dg0 + F_load(x+))   with
//   dg of (4.25).
//
// Switching goes on where the table says only if F_load < F_unload at every x+, which the model file demands
// and the calibration (fit/calibrate.h) takes care of: where they cross neither way has a barrier, whatever
// the loads, and x+ drifts to where the rates balance.
//
// x- stays zero: for fields that do not repole (0 .. 1.5 kV/mm).
#pragma once

#include "model/physics/kinetics.h"

namespace ferrobench::model {

class Parametrized final : public Kinetics {
 public:
  Parametrized(const Model& model, const KineticConstants& constants);

  void start(const Loads& at) override;
  const Means& means() const override { return means_; }
  const Means& propose(double h, const Loads& at, const Loads& bend) override;
  void accept() override;
  void set_polarization(double polarization) override { constants_.polarization = polarization; }
  std::uint64_t domain_steps() const override { return steps_; }

 private:
  struct Rates {
    double log_out = 0, log_back = 0;  // ln(tau r) of + -> 90 and 90 -> +
  };
  Rates rates(const Loads& at, double plus) const;
  double step(double h, const Rates& from, double plus, const Loads& to) const;
  double slope(const Rates& r, double plus) const;

  KineticConstants constants_;
  double barrier_;
  CriticalForce critical_;
  double shift_;  // J/m^3, of both branches by prestress
  Loads at_, proposed_at_;
  Means means_, proposed_;
  std::uint64_t steps_ = 0;
};

}  // namespace ferrobench::model
