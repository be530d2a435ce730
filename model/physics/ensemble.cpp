#include "model/physics/ensemble.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ferrobench::model {

RateColumns Ensemble::Rates::columns(std::size_t first) {
  RateColumns out;
  for (std::size_t j = 0; j < 4; ++j) {
    out.log_rate[j] = log_rate[j].data() + first;
    out.rate[j] = rate[j].data() + first;
  }
  return out;
}

Ensemble::Ensemble(const Domains& given, const KineticConstants& constants, double negligible)
    : constants_(constants), negligible_(negligible), size_(given.size()) {
  // The kernel works on whole vectors: rows past the end must hold harmless numbers.
  const std::size_t padded = size_ + DomainColumns::padding;
  for (auto& column : columns_) column.assign(padded, 0.0);
  for (std::size_t i = 0; i < padded; ++i) {
    const std::size_t from = std::min(i, size_ - 1);
    columns_[barrier][i] = given.barrier[from];
    columns_[inverse_barrier][i] = 1 / given.barrier[from];
    columns_[field][i] = given.field[from];
    columns_[stress][i] = given.stress[from];
    columns_[weight][i] = given.weight[from];
    largest_field_ = std::max(largest_field_, std::abs(given.field[from]));
    largest_stress_ = std::max(largest_stress_, std::abs(given.stress[from]));
    largest_barrier_ = std::max(largest_barrier_, given.barrier[from]);
  }
  for (auto* rates : {&now_, &then_})
    for (std::size_t j = 0; j < 4; ++j) {
      rates->log_rate[j].assign(padded, 0.0);
      rates->rate[j].assign(padded, 0.0);
    }
  for (auto* column : {&wake_path_, &wake_time_, &then_plus_, &then_minus_, &outflow_}) column->assign(padded, 0.0);
}

DomainColumns Ensemble::domains(std::size_t first) const {
  const auto at = [&](Column c) { return columns_[c].data() + first; };
  return {at(barrier), at(inverse_barrier), at(field), at(stress), at(weight), at(plus), at(minus)};
}

void Ensemble::start(const Loads& at) {
  std::fill(columns_[plus].begin(), columns_[plus].end(), 1.0);
  std::fill(columns_[minus].begin(), columns_[minus].end(), 0.0);
  at_ = at;
  time_ = path_ = 0;
  awake_ = size_;
  asleep_plus_ = asleep_minus_ = 0;
  next_wake_path_ = next_wake_time_ = std::numeric_limits<double>::infinity();
  evaluate_rates(constants_, domains(), size_, at_, now_.columns());
  means_ = {};
  double plus_rate = 0;
  for (std::size_t i = 0; i < size_; ++i) plus_rate -= columns_[weight][i] * now_.rate[0][i];
  means_.plus_rate = plus_rate / constants_.relaxation_time;
  proposed_h_ = 1e-3 * constants_.relaxation_time;
  for (std::size_t i = 0; i < size_; ++i) outflow_[i] = now_.rate[0][i];
  put_to_sleep();
}

// Bound on the rise of ln(rate) between two loads: |d dg/dF| <= 1 and |dF/dE|, |dF/dsigma| at their largest.
double Ensemble::path(const Loads& from, const Loads& to) const {
  const auto& k = constants_;
  const double e = std::max(std::abs(from.field), std::abs(to.field)) + largest_field_;
  const double s = std::max(std::abs(from.stress), std::abs(to.stress)) + largest_stress_;
  const double by_field = k.polarization + std::abs(k.piezoelectric) * s + 2 * std::abs(k.half_permittivity) * e;
  const double by_stress = std::abs(k.strain_90) + std::abs(k.piezoelectric) * e + 2 * std::abs(k.half_compliance) * s +
                           largest_barrier_ * std::abs(k.stress_stabilization);
  return k.inverse_energy * (by_field * std::abs(to.field - from.field) + by_stress * std::abs(to.stress - from.stress));
}

void Ensemble::swap_rows(std::size_t i, std::size_t j) {
  for (auto& column : columns_) std::swap(column[i], column[j]);
}

void Ensemble::wake(double path_end, double time_end) {
  if (path_end < next_wake_path_ && time_end < next_wake_time_) return;
  const std::size_t first = awake_;
  next_wake_path_ = next_wake_time_ = std::numeric_limits<double>::infinity();
  for (std::size_t i = awake_; i < size_; ++i) {
    if (path_end < wake_path_[i] && time_end < wake_time_[i]) {
      next_wake_path_ = std::min(next_wake_path_, wake_path_[i]);
      next_wake_time_ = std::min(next_wake_time_, wake_time_[i]);
      continue;
    }
    asleep_plus_ -= columns_[weight][i] * columns_[plus][i];
    asleep_minus_ -= columns_[weight][i] * columns_[minus][i];
    swap_rows(i, awake_);
    wake_path_[i] = wake_path_[awake_];
    wake_time_[i] = wake_time_[awake_];
    ++awake_;
  }
  if (awake_ > first) evaluate_rates(constants_, domains(first), awake_ - first, at_, now_.columns(first));
}

// A domain whose outflow could not move `negligible` within e^3 steps of this length may sleep. Most of the margin is
// granted to the loads' path, the rest to time.
void Ensemble::put_to_sleep() {
  const double span = proposed_h_ / constants_.relaxation_time;
  const double limit = negligible_ * std::exp(-3.0) / span;
  for (std::size_t i = awake_; i-- > 0;) {
    if (outflow_[i] > limit) continue;
    const double margin = outflow_[i] > 0 ? std::min(600.0, std::log(negligible_ / (outflow_[i] * span))) : 600.0;
    const std::size_t last = --awake_;
    asleep_plus_ += columns_[weight][i] * columns_[plus][i];
    asleep_minus_ += columns_[weight][i] * columns_[minus][i];
    if (i != last) {
      swap_rows(i, last);
      outflow_[i] = outflow_[last];
      for (std::size_t j = 0; j < 4; ++j) {
        now_.log_rate[j][i] = now_.log_rate[j][last];
        now_.rate[j][i] = now_.rate[j][last];
      }
    }
    wake_path_[last] = path_ + 0.75 * margin;
    wake_time_[last] = time_ + proposed_h_ * std::exp(0.25 * margin);
    next_wake_path_ = std::min(next_wake_path_, wake_path_[last]);
    next_wake_time_ = std::min(next_wake_time_, wake_time_[last]);
  }
}

const Means& Ensemble::propose(double h, const Loads& at) {
  wake(path_ + path(at_, at), time_ + h);
  proposed_at_ = at;
  proposed_h_ = h;
  held_ = at.field == at_.field && at.stress == at_.stress;
  const StepOutput out{then_plus_.data(), then_minus_.data(), outflow_.data(), negligible_};
  const auto result = held_ ? step_domains_held(constants_, domains(), awake_, h, now_.columns(), out)
                            : step_domains(constants_, domains(), awake_, h, at, now_.columns(), then_.columns(), out);
  domain_steps_ += awake_;
  proposed_ = {result.plus + asleep_plus_, result.minus + asleep_minus_, result.plus_rate, result.minus_rate};
  return proposed_;
}

void Ensemble::accept() {
  path_ += path(at_, proposed_at_);
  time_ += proposed_h_;
  at_ = proposed_at_;
  means_ = proposed_;
  std::copy_n(then_plus_.begin(), awake_, columns_[plus].begin());
  std::copy_n(then_minus_.begin(), awake_, columns_[minus].begin());
  if (!held_) std::swap(now_, then_);
  put_to_sleep();
}

}  // namespace ferrobench::model
