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
// and the calibration (inference/study/calibrate.h) takes care of: where they cross neither way has a
// barrier, whatever the loads, and x+ drifts to where the rates balance.
//
// x- stays zero: for fields that do not repole (0 .. 1.5 kV/mm).
#pragma once

#include "model/physics/implicit.h"
#include "model/physics/kinetics.h"

namespace ferrobench::model {

template <class T>
struct ParametrizedLaw {
  explicit ParametrizedLaw(const ModelOf<T>& model, const KineticConstantsOf<T>& its_constants)
      : constants(its_constants),
        barrier(model.material.barrier),
        critical(model.polycrystal.critical_force.value()),
        shift(critical.prestress_shift * (model.load.prestress - critical.prestress)) {}

  struct Rates {
    T log_out = 0, log_back = 0;  // ln(tau r) of + -> 90 and 90 -> +
  };
  Rates rates(const LoadsOf<T>& at, const T& plus) const;
  T slope(const Rates& r, const T& plus) const;  // dx+/dt, 1/s
  // What a step that begins with `plus` and the rates `from` misses `end` by, if it ends at the loads `to`.
  T miss(const T& h, const Rates& from, const T& plus, const LoadsOf<T>& to, const T& end) const;

  KineticConstantsOf<T> constants;
  T barrier;
  CriticalForce critical;
  T shift;  // J/m^3, of both branches by prestress
};

class Parametrized final : public Kinetics {
 public:
  Parametrized(const Model& model, const KineticConstants& constants);

  void start(const Loads& at, const Fractions& fractions) override;
  const Means& means() const override { return means_; }
  const Means& propose(double h, const Loads& at, const Loads& bend) override;
  void accept() override;
  void set_polarization(double polarization) override { law_.constants.polarization = polarization; }
  std::uint64_t domain_steps() const override { return steps_; }

 private:
  double step(double h, const ParametrizedLaw<double>::Rates& from, double plus, const Loads& to) const;

  ParametrizedLaw<double> law_;
  Loads at_, proposed_at_;
  Means means_, proposed_;
  std::uint64_t steps_ = 0;
};

}  // namespace ferrobench::model
