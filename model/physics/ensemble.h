// The phase fractions of all domains in time: the kernel, applied only where something happens.
//
// Most domains do nothing most of the time: their rates are too small to matter, or they have switched. Such
// a domain sleeps, within bounds that keep what it misses below `negligible`: ln(rate) rises by no more than
// the way of the loads in units of kT, so each sleeper has a lowest and a highest field, a length of the
// stress's path and a time, at the first of which it is woken.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "model/physics/domains.h"
#include "model/physics/kernel.h"
#include "model/physics/kinetics.h"

namespace ferrobench::model {

// Rows of an ensemble that wake in a step and that fall asleep after it, in this order. Each changes its
// place with the first asleep or the last awake.
struct InactiveSetChange {
  std::vector<std::size_t> woken, slept;
};

class Ensemble final : public Kinetics {
 public:
  // negligible: what may be missed of one domain's fractions in each of its sleeps.
  Ensemble(const Domains& given, const KineticConstants& constants, double negligible);

  void start(const Loads& at, const Fractions& fractions) override;
  const Means& means() const override { return means_; }
  const Means& propose(double h, const Loads& at, const Loads& bend) override;
  void accept() override;
  void set_polarization(double polarization) override { constants_.polarization = polarization; }
  std::uint64_t domain_steps() const override { return domain_steps_; }

  // From now on rows wake and fall asleep only as they are told, from the start on.
  void follow() { follows_ = true; }
  void wake(const std::vector<std::size_t>& rows);
  void put_to_sleep(const std::vector<std::size_t>& rows);
  // What has changed since this was last called, or since the start; kept from the first call of record() on.
  void record() { records_ = true; }
  InactiveSetChange take_change() { return std::exchange(change_, {}); }

  // What the last proposal came from.
  struct Proposal {
    const KineticConstants& constants;
    double polarization_then;  // P_+ of the rates before
    DomainColumns domains;     // rows that are awake first, with the fractions at the step's start
    std::size_t awake, size;
    double h;
    LoadPath path;
    RateColumns before, after;
    const double *plus, *minus;  // fractions at its end
  };
  Proposal proposal();
  // Of all rows as they start, before the first proposal: one that takes no time.
  Proposal start_proposal();

 private:
  enum Column { barrier, inverse_barrier, field, stress, weight, plus, minus, column_count };
  struct Rates {
    std::array<std::vector<double>, most_transitions> log_rate, rate;  // of all transitions there are
    RateColumns columns(std::size_t first = 0);
  };

  DomainColumns domains(std::size_t first = 0) const;
  void swap_rows(std::size_t i, std::size_t j);
  // The row that becomes the last one awake, or the first asleep.
  void wake_row(std::size_t i);
  std::size_t put_row_to_sleep(std::size_t i);
  // Bounds on |d ln(rate)| per field [m/V] and per stress [1/Pa] for loads up to these.
  struct Sensitivity {
    double field = 0, stress = 0;
    bool ordered = true;  // a falling field never raises what a rising one does
  };
  Sensitivity sensitivity(const Loads& a, const Loads& b) const;
  void wake(const Loads& to, double stress_path_end, double time_end);
  double horizon() const;
  void put_to_sleep(double field_step);

  KineticConstants constants_;
  double negligible_;
  std::size_t size_;
  std::size_t awake_ = 0;  // the first rows are awake, the others asleep
  std::array<std::vector<double>, column_count> columns_;
  enum Bound { lowest_field, highest_field, longest_stress_path, latest_time, bound_count };
  std::array<std::vector<double>, bound_count> bounds_;  // of the sleepers
  std::vector<std::size_t> found_;                       // rows that a search has found
  double asleep_plus_ = 0, asleep_minus_ = 0;
  Rates now_, then_;
  std::vector<double> then_plus_, then_minus_, outflow_falling_, outflow_rising_;
  Loads at_{}, proposed_at_{}, bend_{};
  bool held_ = false, follows_ = false, records_ = false;
  InactiveSetChange change_;
  double polarization_then_ = 0;                                         // P_+ of the rates `now_`
  double largest_field_ = 0, largest_stress_ = 0, largest_barrier_ = 0;  // of the internal loads and barriers
  double time_ = 0, stress_path_ = 0, proposed_h_ = 0;
  struct Rest {
    double field = 0, since = 0;
  };
  std::array<Rest, 2> rests_;  // fields that the present one has stayed near, the newer one last
  Means means_, proposed_;
  std::uint64_t domain_steps_ = 0;
};

}  // namespace ferrobench::model
