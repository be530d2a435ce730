// The phase fractions of all domains in time: the kernel, applied only where something happens.
//
// Most domains do nothing most of the time: their rates are too small to matter, or they have switched. Such a domain
// sleeps. While the loads change, ln(rate) can rise by no more than the length of their path in units of kT, which is kept
// as a running sum; a sleeping domain is woken when that sum, or the time, could have let it change by `negligible`.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "model/physics/domains.h"
#include "model/physics/kernel.h"
#include "model/physics/kinetics.h"

namespace ferrobench::model {

class Ensemble final : public Kinetics {
 public:
  // negligible: what may be missed of one domain's fractions in each of its sleeps.
  Ensemble(const Domains& domains, const KineticConstants& constants, double negligible);

  void start(const Loads& at) override;
  const Means& means() const override { return means_; }
  const Means& propose(double h, const Loads& at) override;
  void accept() override;
  void set_polarization(double polarization) override { constants_.polarization = polarization; }
  std::uint64_t domain_steps() const override { return domain_steps_; }

 private:
  enum Column { barrier, inverse_barrier, field, stress, weight, plus, minus, column_count };
  struct Rates {
    std::array<std::vector<double>, 4> log_rate, rate;
    RateColumns columns(std::size_t first = 0);
  };

  DomainColumns domains(std::size_t first = 0) const;
  void swap_rows(std::size_t i, std::size_t j);
  double path(const Loads& from, const Loads& to) const;
  void wake(double path_end, double time_end);
  void put_to_sleep();

  KineticConstants constants_;
  double negligible_;
  std::size_t size_;
  std::size_t awake_ = 0;  // the first rows are awake, the others asleep
  std::array<std::vector<double>, column_count> columns_;
  std::vector<double> wake_path_, wake_time_;  // of the sleeping
  double next_wake_path_ = 0, next_wake_time_ = 0;
  double asleep_plus_ = 0, asleep_minus_ = 0;
  Rates now_, then_;
  std::vector<double> then_plus_, then_minus_, outflow_;
  Loads at_{}, proposed_at_{};
  bool held_ = false;
  double largest_field_ = 0, largest_stress_ = 0, largest_barrier_ = 0;  // of the internal loads and barriers
  double time_ = 0, path_ = 0, proposed_h_ = 0;
  Means means_, proposed_;
  std::uint64_t domain_steps_ = 0;
};

}  // namespace ferrobench::model
