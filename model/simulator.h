// Plays a field through a model, piece by piece, and gives the channels at any times along it.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "model/model.h"
#include "protocols/past.h"

namespace ferrobench::model {

struct SimulationOptions {
  // Largest error of the mean polarization and strain from stepping in time, as a share of their switching
  // range (2 P_r and |eps_90|). Where a mean field makes loops all but vertical, what is off is when they
  // switch, and the error (rms) is up to 40 times this: 1.1 % at 1e-3, 0.3 % at 1e-4.
  double tolerance = 1e-4;
  // Nodes of the domain distribution; 0 chooses enough for `tolerance`.
  int domains = 0;
  std::uint64_t shift =
      0;  // which of the lattice's shifts; two of them compared estimate the quadrature error
  bool every_spread = false;     // of make_domains
  std::uint64_t most_steps = 0;  // after so many, rejected ones too, Error(numerical); 0: no bound
  // Asked before every step, from whichever thread simulates: true ends it with Error(cancelled).
  const std::function<bool()>* stop = nullptr;
  // Where it is given, counts the simulations that were begun.
  std::atomic<std::uint64_t>* begun = nullptr;
  // What the specimen has been through before time 0; it is played first and does not come out. Null, or
  // unknown: it is poled towards +.
  const protocols::Past* past = nullptr;
};

// Throws Error(cancelled) if that is wanted.
void check_stop(const SimulationOptions& options);

// Simulated so, a model is hardly told from a specimen, which has countless domains: in holds of soft PZT
// against a stiff spring it is 0.004 % of the range off (rms), with 1,000 domains 0.1 %, and a good bench has
// 0.02 % of noise.
inline constexpr SimulationOptions below_noise{.tolerance = 1e-5, .domains = 8000};

// The channels at a list of times; each span either empty (not wanted) or as long as the times.
struct ChannelSpans {
  std::span<double> field;         // V/m, at the amplifier's monitor
  std::span<double> charge;        // C, absolute
  std::span<double> displacement;  // m
  std::span<double> force;         // N
  std::span<double> polarization;  // C/m^2
  std::span<double> strain;        // 1, active material
  std::span<double> stress;        // Pa
  std::span<double> fraction_plus, fraction_minus;
};

struct SimulationStatistics {
  std::uint64_t steps = 0;
  std::uint64_t tried = 0;         // steps, with those that were rejected
  std::uint64_t domain_steps = 0;  // single domains advanced by one step
  // Estimate of the error of stepping in time, share of the switching range, rms over the steps so far. Of
  // 220 random models and programs at a tolerance of 1e-4 the true one was 0.25 to 5.5 times this, 3.7e-4 at
  // most.
  double time_error = 0;
};

class Simulator {
 public:
  explicit Simulator(const Model& model, const SimulationOptions& options = {});
  ~Simulator();
  Simulator(Simulator&&) noexcept;
  Simulator& operator=(Simulator&&) noexcept;

  // After the past of the options, under the commanded field, at time 0; of itself +180 throughout, at rest.
  // A past that is the program itself is Error(invalid_params), as there is none yet.
  void start(double field);
  double time() const;   // s
  double field() const;  // V/m, commanded

  // The commanded field goes linearly from field() to `field` in `duration` [s]; `times` (rising, in
  // (time(), time() + duration], or also time() itself before the first piece) are where `out` is wanted.
  void play(double duration, double field, std::span<const double> times, const ChannelSpans& out);

  const SimulationStatistics& statistics() const;

  struct State;  // simulator_state.h

 private:
  std::unique_ptr<State> state_;
};

// A whole field record: linear between its knots. `time` and `field` are equally long, time strictly rising.
// Channels come out at the knots themselves.
struct Trajectory {
  std::vector<double> field, charge, displacement, force;
  double time_error = 0;        // as in SimulationStatistics
  double quadrature_error = 0;  // rms over the range, from two shifts of the lattice; only if asked for
};
Trajectory simulate(const Model& model, std::span<const double> time, std::span<const double> field,
                    const SimulationOptions& options = {}, bool estimate_quadrature = false);

// The knots of a field that do not lie on the line between their neighbours, the first and the last included.
std::vector<std::size_t> corners(std::span<const double> time, std::span<const double> field);

// A field that is linear between few knots, with the channels at times of their own: rising, from the first
// knot (time 0) to the last.
SimulationStatistics simulate_at(const Model& model, std::span<const double> knot_time,
                                 std::span<const double> knot_field, std::span<const double> times,
                                 const ChannelSpans& out, const SimulationOptions& options = {});
// The same for several models at once that differ in their sensors only, which the specimen does not feel:
// one simulation, seen through the sensors of each.
SimulationStatistics simulate_alike(std::span<const Model> models, std::span<const double> knot_time,
                                    std::span<const double> knot_field, std::span<const double> times,
                                    std::span<const ChannelSpans> out, const SimulationOptions& options = {});
// The model that is the same for all that differ from it in their sensors only.
Model without_sensors(Model model);

}  // namespace ferrobench::model
