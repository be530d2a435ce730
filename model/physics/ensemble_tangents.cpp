#include "model/physics/ensemble_tangents.h"

#include <algorithm>
#include <utility>

namespace ferrobench::model {
namespace {

template <class F>
void for_each_column(SpreadSlopes& domains, F&& f) {
  f(domains.weight);
  f(domains.by_skewness);
  for (auto* columns : {&domains.quantile, &domains.by_inverse_freedom})
    for (auto& column : *columns) f(column);
}

std::array<const double*, 3> data_of(const SpreadColumns& columns) {
  return {columns[0].data(), columns[1].data(), columns[2].data()};
}

}  // namespace

EnsembleTangents::EnsembleTangents(SpreadSlopes domains, std::size_t parameters)
    : parameters_(parameters),
      size_(domains.size()),
      directions_(parameters + 3),
      given_(std::move(domains)) {
  const std::size_t padded = size_ + DomainColumns::padding;
  for (auto& d : directions_)
    for (auto* column : {&d.plus, &d.minus}) column->assign(padded, 0.0);
  for_each_column(given_, [padded](auto& column) { column.resize(padded, 0.0); });
}

void EnsembleTangents::clear(Direction& d) {
  std::fill(d.plus.begin(), d.plus.end(), 0.0);
  std::fill(d.minus.begin(), d.minus.end(), 0.0);
  d.asleep_plus = d.asleep_minus = 0;
  d.moves = false;
}

void EnsembleTangents::start(const InactiveSetChange& change) {
  for (auto& d : directions_) clear(d);
  rows_ = given_;
  awake_ = size_;
  put_to_sleep(change.slept);
}

void EnsembleTangents::swap_rows(std::size_t i, std::size_t j) {
  for_each_column(rows_, [i, j](auto& column) { std::swap(column[i], column[j]); });
  for (std::size_t p = 0; p < parameters_; ++p) {
    auto& d = directions_[p];
    if (!d.moves) continue;
    std::swap(d.plus[i], d.plus[j]);
    std::swap(d.minus[i], d.minus[j]);
  }
}

void EnsembleTangents::wake(const std::vector<std::size_t>& rows) {
  for (const std::size_t i : rows) {
    for (std::size_t p = 0; p < parameters_; ++p) {
      auto& d = directions_[p];
      d.asleep_plus -= rows_.weight[i] * d.plus[i];
      d.asleep_minus -= rows_.weight[i] * d.minus[i];
    }
    swap_rows(i, awake_++);
  }
}

void EnsembleTangents::put_to_sleep(const std::vector<std::size_t>& rows) {
  for (const std::size_t i : rows) {
    for (std::size_t p = 0; p < parameters_; ++p) {
      auto& d = directions_[p];
      d.asleep_plus += rows_.weight[i] * d.plus[i];
      d.asleep_minus += rows_.weight[i] * d.minus[i];
    }
    swap_rows(i, --awake_);
  }
}

void EnsembleTangents::step(const Ensemble::Proposal& proposal, const std::vector<Causes>& causes,
                            std::vector<MeanTangents>& out) {
  std::vector<FractionTangents> moving;
  std::vector<std::size_t> which;
  for (std::size_t n = 0; n < directions_.size(); ++n) {
    auto& d = directions_[n];
    d.moves = d.moves || std::any_of(causes[n].begin(), causes[n].end(), [](double c) { return c != 0; });
    if (!d.moves) continue;
    moving.push_back({d.plus.data(), d.minus.data(), &causes[n], n >= parameters_});
    which.push_back(n);
  }
  const TangentStep step{.h = proposal.h,
                         .path = proposal.path,
                         .polarization_before = proposal.polarization_then,
                         .before = proposal.before,
                         .after = proposal.after,
                         .quantile = data_of(rows_.quantile),
                         .by_inverse_freedom = data_of(rows_.by_inverse_freedom),
                         .by_skewness = rows_.by_skewness.data()};
  std::vector<MeanTangents> means;
  step_tangents(proposal.constants, proposal.domains, proposal.awake, step, moving, means);
  out.assign(directions_.size(), {});
  for (std::size_t i = 0; i < which.size(); ++i) {
    const auto& d = directions_[which[i]];
    out[which[i]] = means[i];
    out[which[i]].plus += d.asleep_plus;
    out[which[i]].minus += d.asleep_minus;
  }
}

void EnsembleTangents::settle(const std::array<std::vector<double>, 3>& loads) {
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& from = directions_[parameters_ + k];
    if (!from.moves) continue;
    for (std::size_t p = 0; p < parameters_; ++p) {
      const double by = loads[k][p];
      if (by == 0) continue;
      auto& d = directions_[p];
      d.moves = true;
      for (std::size_t i = 0; i < awake_; ++i) d.plus[i] += by * from.plus[i];
      for (std::size_t i = 0; i < awake_; ++i) d.minus[i] += by * from.minus[i];
    }
  }
}

}  // namespace ferrobench::model
