// Domains and columns to run the kernel on, outside the ensemble: every domain, none asleep.
#pragma once

#include <array>
#include <vector>

#include "model/physics/domains.h"
#include "model/physics/kernel.h"

namespace ferrobench::bench {

class KernelBench {
 public:
  struct Rates {
    std::array<std::vector<double>, model::most_transitions> log_rate, rate;  // ln(tau r), tau r
  };

  KernelBench(const model::Domains& domains, const model::KineticConstants& constants)
      : constants_(constants), size_(domains.size()) {
    const std::size_t padded = size_ + model::DomainColumns::padding;
    const auto column = [&](const std::vector<double>& from) {
      auto out = from;
      out.resize(padded, from.back());
      return out;
    };
    barrier_ = inverse_barrier_ = column(domains.barrier);
    for (auto& b : inverse_barrier_) b = 1 / b;
    field_ = column(domains.field);
    stress_ = column(domains.stress);
    weight_ = column(domains.weight);
    plus_.assign(padded, 0.5);
    minus_.assign(padded, 0.2);
    for (auto* v : {&next_plus_, &next_minus_, &falling_, &rising_}) v->assign(padded, 0);
    for (auto* rates : {&before_, &after_})
      for (auto* columns : {&rates->log_rate, &rates->rate})
        for (auto& v : *columns) v.assign(padded, 0);
  }

  std::size_t size() const { return size_; }
  void start(const model::Loads& at) {
    model::evaluate_rates(constants_, domains(), size_, at, rates(before_));
  }
  model::StepResult step(double h, const model::LoadPath& path) {
    return model::step_domains(constants_, domains(), size_, h, path, rates(before_), rates(after_),
                               output());
  }
  model::StepResult hold(double h) {
    return model::step_domains_held(constants_, domains(), size_, h, rates(before_), output());
  }
  const std::vector<double>& plus() const { return next_plus_; }
  const std::vector<double>& minus() const { return next_minus_; }
  const Rates& before() const { return before_; }
  const Rates& after() const { return after_; }

 private:
  model::DomainColumns domains() const {
    return {barrier_.data(), inverse_barrier_.data(), field_.data(),
            stress_.data(),  weight_.data(),          plus_.data(),
            minus_.data()};
  }
  static model::RateColumns rates(Rates& v) {
    model::RateColumns out;
    for (std::size_t j = 0; j < model::most_transitions; ++j) {
      out.log_rate[j] = v.log_rate[j].data();
      out.rate[j] = v.rate[j].data();
    }
    return out;
  }
  model::StepOutput output() {
    return {next_plus_.data(), next_minus_.data(), falling_.data(), rising_.data(), 1e-6};
  }

  model::KineticConstants constants_;
  std::size_t size_;
  std::vector<double> barrier_, inverse_barrier_, field_, stress_, weight_, plus_, minus_;
  std::vector<double> next_plus_, next_minus_, falling_, rising_;
  Rates before_, after_;
};

}  // namespace ferrobench::bench
