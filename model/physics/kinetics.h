// What the simulator needs of the phase fractions, however they are modelled.
#pragma once

#include <cstdint>
#include <memory>

#include "model/physics/wells.h"

namespace ferrobench::model {

// Means over all domains.
template <class T>
struct MeansOf {
  T plus = 1, minus = 0;            // <x+>, <x->
  T plus_rate = 0, minus_rate = 0;  // d/dt, 1/s
  T ninety() const { return 1 - plus - minus; }
};
using Means = MeansOf<double>;

// Of all domains alike, at the start.
struct Fractions {
  double plus = 1, minus = 0;
};

class Kinetics {
 public:
  virtual ~Kinetics() = default;
  // All domains with these fractions, at these loads. Throws Error(bad_model) if there is no such state.
  virtual void start(const Loads& at, const Fractions& fractions) = 0;
  virtual const Means& means() const = 0;
  // The state after `h` seconds in which the loads go to `at`, `bend` off the straight line at mid-step;
  // nothing is kept until accept().
  virtual const Means& propose(double h, const Loads& at, const Loads& bend) = 0;
  virtual void accept() = 0;
  // P_+ may change in time (fatigue): takes effect with the next proposal.
  virtual void set_polarization(double polarization) = 0;
  virtual std::uint64_t domain_steps() const = 0;
};

}  // namespace ferrobench::model
