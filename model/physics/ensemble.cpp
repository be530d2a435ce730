#include "model/physics/ensemble.h"

#include <algorithm>
#include <cmath>

#include "model/physics/sleepers.h"

namespace ferrobench::model {
namespace {

constexpr double largest_growth = 1e260;  // of an outflow, in a sleeper's bounds
constexpr double share_of_rest = 0.2;     // by which steps grow in a hold

}  // namespace

RateColumns Ensemble::Rates::columns(std::size_t first) {
  RateColumns out;
  for (std::size_t j = 0; j < most_transitions && !rate[j].empty(); ++j) {
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
  // So must those past the last one awake: rates that agree with their logarithms, even if long out of date.
  for (auto* rates : {&now_, &then_})
    for (std::size_t j = 0; j < transition_count(constants_); ++j) {
      rates->log_rate[j].assign(padded, 0.0);
      rates->rate[j].assign(padded, 1.0);
    }
  for (auto* column : {&then_plus_, &then_minus_, &outflow_falling_, &outflow_rising_})
    column->assign(padded, 0.0);
  for (auto& column : bounds_) column.assign(padded, 0.0);
  found_.resize(size_);
}

DomainColumns Ensemble::domains(std::size_t first) const {
  const auto at = [&](Column c) { return columns_[c].data() + first; };
  return {at(barrier), at(inverse_barrier), at(field), at(stress), at(weight), at(plus), at(minus)};
}

void Ensemble::start(const Loads& at, const Fractions& fractions) {
  std::fill(columns_[plus].begin(), columns_[plus].end(), fractions.plus);
  std::fill(columns_[minus].begin(), columns_[minus].end(), fractions.minus);
  at_ = at;
  polarization_then_ = constants_.polarization;
  time_ = stress_path_ = 0;
  change_ = {};
  rests_.fill({at.field, 0});
  awake_ = size_;
  asleep_plus_ = asleep_minus_ = 0;
  evaluate_rates(constants_, domains(), size_, at_, now_.columns());
  means_ = {fractions.plus, fractions.minus, 0, 0};
  const double ninety = means_.ninety();
  double plus_rate = 0, minus_rate = 0;
  const bool direct = transition_count(constants_) > 4;
  for (std::size_t i = 0; i < size_; ++i) {
    const auto rate = [&](std::size_t j) { return now_.rate[j][i]; };
    const double to_minus = direct ? rate(4) * fractions.plus : 0,
                 to_plus = direct ? rate(5) * fractions.minus : 0;
    plus_rate += columns_[weight][i] * (rate(1) * ninety - rate(0) * fractions.plus + to_plus - to_minus);
    minus_rate += columns_[weight][i] * (rate(2) * ninety - rate(3) * fractions.minus + to_minus - to_plus);
    outflow_falling_[i] = rate(0) * fractions.plus + rate(2) * ninety + to_minus;
    outflow_rising_[i] = rate(1) * ninety + rate(3) * fractions.minus + to_plus;
  }
  means_.plus_rate = plus_rate / constants_.relaxation_time;
  means_.minus_rate = minus_rate / constants_.relaxation_time;
  proposed_h_ = 1e-3 * constants_.relaxation_time;
  put_to_sleep(0);
}

// |d dg/dF| <= 1, with |dF/dE| and |dF/dsigma| at their largest. The force between both 180 wells is twice
// the part of the others that is odd in the field.
Ensemble::Sensitivity Ensemble::sensitivity(const Loads& a, const Loads& b) const {
  const auto& k = constants_;
  const double e = std::max(std::abs(a.field), std::abs(b.field)) + largest_field_;
  const double s = std::max(std::abs(a.stress), std::abs(b.stress)) + largest_stress_;
  const double besides = std::abs(k.piezoelectric) * s + 2 * std::abs(k.half_permittivity) * e;
  const double by_stress =
      std::abs(k.strain_90) + std::abs(k.piezoelectric) * e + 2 * std::abs(k.half_compliance) * s +
      largest_barrier_ * std::exp(std::abs(k.barrier_asymmetry)) * std::abs(k.stress_stabilization);
  const double scale = (transition_count(k) > 4 ? 2 : 1) * k.inverse_energy;
  return {scale * (k.polarization + besides), scale * by_stress, besides < k.polarization};
}

void Ensemble::swap_rows(std::size_t i, std::size_t j) {
  for (auto& column : columns_) std::swap(column[i], column[j]);
}

void Ensemble::wake_row(std::size_t i) {
  asleep_plus_ -= columns_[weight][i] * columns_[plus][i];
  asleep_minus_ -= columns_[weight][i] * columns_[minus][i];
  swap_rows(i, awake_);
  for (auto& column : bounds_) column[i] = column[awake_];
  ++awake_;
  if (records_) change_.woken.push_back(i);
}

std::size_t Ensemble::put_row_to_sleep(std::size_t i) {
  const std::size_t last = --awake_;
  asleep_plus_ += columns_[weight][i] * columns_[plus][i];
  asleep_minus_ += columns_[weight][i] * columns_[minus][i];
  if (i != last) {
    swap_rows(i, last);
    for (std::size_t j = 0; j < transition_count(constants_); ++j) {
      now_.log_rate[j][i] = now_.log_rate[j][last];
      now_.rate[j][i] = now_.rate[j][last];
    }
  }
  if (records_) change_.slept.push_back(i);
  return last;
}

void Ensemble::wake(const Loads& to, double stress_path_end, double time_end) {
  if (follows_) return;
  const std::size_t first = awake_;
  const std::size_t found = find_due({bounds_[lowest_field].data(), bounds_[highest_field].data(),
                                      bounds_[longest_stress_path].data(), bounds_[latest_time].data()},
                                     first, size_, {to.field, stress_path_end, time_end}, found_.data());
  for (std::size_t n = 0; n < found; ++n) wake_row(found_[n]);
  if (found > 0) evaluate_rates(constants_, domains(first), found, at_, now_.columns(first));
}

void Ensemble::wake(const std::vector<std::size_t>& rows) {
  const std::size_t first = awake_;
  for (const std::size_t row : rows) wake_row(row);
  if (!rows.empty()) evaluate_rates(constants_, domains(first), rows.size(), at_, now_.columns(first));
}

void Ensemble::put_to_sleep(const std::vector<std::size_t>& rows) {
  for (const std::size_t row : rows) put_row_to_sleep(row);
}

// The time over which what a sleeper misses is counted: the last step's or, where many short ones were asked
// for, a fifth of the time in which the field has hardly moved, which is that of a step in a hold.
double Ensemble::horizon() const {
  return std::max(proposed_h_, share_of_rest * (time_ - rests_[0].since));
}

// A domain may sleep if its outflow could not move `negligible` within e^1.5 horizons, nor will in the next.
// Half of the margin is granted to the field, the rest to stress and time.
void Ensemble::put_to_sleep(double field_step) {
  if (follows_) return;
  const auto s = sensitivity(at_, at_);
  const double window = horizon(), span = window / constants_.relaxation_time;
  const double limit = negligible_ * std::exp(-1.5) / span;
  const double field_share = 0.5 / s.field, stress_share = 0.25 / s.stress;
  const double next_low = at_.field + 2 * std::min(0.0, field_step),
               next_high = at_.field + 2 * std::max(0.0, field_step);
  // Outflows from which on the next step would already wake the domain: known before any logarithm is taken.
  const double most_falling = negligible_ / span * std::exp((next_low - at_.field) / field_share),
               most_rising = negligible_ / span * std::exp((at_.field - next_high) / field_share);
  const double most = s.ordered ? limit : std::min({limit, most_falling, most_rising});
  std::size_t found = find_quiet(outflow_falling_.data(), outflow_rising_.data(), awake_,
                                 {most_falling, most_rising, most}, found_.data());
  // How many times larger the outflow may become, at most as far as the logarithm below may go.
  const auto growth = [&](double outflow) {
    return outflow > 0 ? std::min(largest_growth, negligible_ / (outflow * span)) : largest_growth;
  };
  while (found-- > 0) {
    const std::size_t i = found_[found];
    double falling = outflow_falling_[i], rising = outflow_rising_[i];
    if (!s.ordered) falling = rising = falling + rising;
    const double growth_falling = growth(falling), growth_rising = growth(rising);
    const double margin_falling = std::log(growth_falling), margin_rising = std::log(growth_rising);
    const std::size_t last = put_row_to_sleep(i);
    bounds_[lowest_field][last] = at_.field - field_share * margin_falling;
    bounds_[highest_field][last] = at_.field + field_share * margin_rising;
    bounds_[longest_stress_path][last] =
        stress_path_ + stress_share * std::min(margin_falling, margin_rising);
    bounds_[latest_time][last] =
        time_ + window * std::sqrt(std::sqrt(std::min(growth_falling, growth_rising)));
  }
}

const Means& Ensemble::propose(double h, const Loads& at, const Loads& bend) {
  const double stress_path = stress_path_ + std::abs(at.stress - at_.stress) + 2 * std::abs(bend.stress);
  wake(at, stress_path, time_ + h);
  proposed_at_ = at;
  bend_ = bend;
  proposed_h_ = h;
  held_ = at.field == at_.field && at.stress == at_.stress && bend.field == 0 && bend.stress == 0 &&
          constants_.polarization == polarization_then_;
  const StepOutput out{then_plus_.data(), then_minus_.data(), outflow_falling_.data(), outflow_rising_.data(),
                       negligible_};
  const auto result = held_ ? step_domains_held(constants_, domains(), awake_, h, now_.columns(), out)
                            : step_domains(constants_, domains(), awake_, h, {at_, at, bend}, now_.columns(),
                                           then_.columns(), out);
  domain_steps_ += awake_;
  proposed_ = {result.plus + asleep_plus_, result.minus + asleep_minus_, result.plus_rate, result.minus_rate};
  return proposed_;
}

Ensemble::Proposal Ensemble::proposal() {
  return {constants_,
          polarization_then_,
          domains(),
          awake_,
          size_,
          proposed_h_,
          {at_, proposed_at_, bend_},
          now_.columns(),
          held_ ? now_.columns() : then_.columns(),
          then_plus_.data(),
          then_minus_.data()};
}

Ensemble::Proposal Ensemble::start_proposal() {
  evaluate_rates(constants_, domains(), size_, at_, then_.columns());
  auto out = proposal();
  out.awake = size_;
  out.h = 0;
  out.path = {at_, at_, {}};
  out.before = out.after = then_.columns();
  return out;
}

void Ensemble::accept() {
  const double field_step = proposed_at_.field - at_.field;
  stress_path_ += std::abs(proposed_at_.stress - at_.stress);
  time_ += proposed_h_;
  at_ = proposed_at_;
  // Hardly: ln(rate) changed by one or two.
  if (std::abs(at_.field - rests_[1].field) * sensitivity(at_, at_).field > 1)
    rests_ = {rests_[1], Rest{at_.field, time_}};
  means_ = proposed_;
  std::copy_n(then_plus_.begin(), awake_, columns_[plus].begin());
  std::copy_n(then_minus_.begin(), awake_, columns_[minus].begin());
  if (!held_) std::swap(now_, then_);
  polarization_then_ = constants_.polarization;
  put_to_sleep(field_step);
}

}  // namespace ferrobench::model
