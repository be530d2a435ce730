#include "model/inference/residuals/whitened_residuals.h"

#include <algorithm>

#include "model/inference/common/parallel.h"

namespace ferrobench::model::inference {
namespace {

// What a specimen feels of a setting: all but the sensors and the gains of what is compared. The first gain
// is that of the field, which may be the drive.
nlohmann::json felt(const Setting& s) {
  return {to_json(without_sensors(s.model)), s.gain[0], s.field_offset, s.spring_factor, s.prestress_factor};
}

}  // namespace

void WhitenedResiduals::simulate_by(const SimulationOptions& simulation) {
  const auto stood = simulation_;
  simulation_ = simulation;
  simulation_.stop = stood.stop;
  simulation_.begun = stood.begun;
  find_difference();
}

void WhitenedResiduals::anchor(const Hypothesis& hypothesis, const Eigen::VectorXd& z,
                               Eigen::VectorXd residual) {
  difference_ = nullptr;
  anchor_ = {hypothesis, z, std::move(residual), simulation_, {}};
}

void WhitenedResiduals::release() {
  difference_ = nullptr;
  if (anchor_) simulation_ = anchor_->simulation;
  anchor_.reset();
}

void WhitenedResiduals::find_difference() {
  difference_ = nullptr;
  if (anchor_ && simulation_.domains > anchor_->simulation.domains) anchor_.reset();
  if (!anchor_) return;
  const std::tuple key{simulation_.domains, simulation_.shift, simulation_.tolerance};
  auto found = anchor_->differences.find(key);
  if (found == anchor_->differences.end()) {
    Eigen::VectorXd difference = anchor_->residual - evaluate(anchor_->hypothesis, anchor_->z);
    if (is_unsolved(difference)) difference.setZero();
    found = anchor_->differences.emplace(key, std::move(difference)).first;
  }
  difference_ = &found->second;
}

std::vector<Eigen::VectorXd> WhitenedResiduals::evaluate(
    const std::vector<std::pair<const Hypothesis*, Eigen::VectorXd>>& places) const {
  std::vector<Eigen::VectorXd> out(places.size(), Eigen::VectorXd(size_));
  std::vector<std::vector<Wanted>> groups;
  std::vector<nlohmann::json> felt_by;  // a group's settings
  for (std::size_t p = 0; p < places.size(); ++p) {
    auto setting = possible_setting(*places[p].first, places[p].second);
    if (!setting) {
      out[p].setConstant(unsolvable);
      continue;
    }
    Wanted wanted{*std::move(setting), &out[p]};
    auto feels = places.size() > 1 ? felt(wanted.setting) : nlohmann::json();
    const auto group = static_cast<std::size_t>(std::ranges::find(felt_by, feels) - felt_by.begin());
    if (group == groups.size()) {
      groups.emplace_back();
      felt_by.push_back(std::move(feels));
    }
    groups[group].push_back(std::move(wanted));
  }
  const auto ordered = parts();
  in_parallel(groups.size() * ordered.size(), threads_,
              [&](std::size_t i) { fill(groups[i % groups.size()], ordered[i / groups.size()]); });
  if (difference_ != nullptr)
    for (auto& residual : out) residual += *difference_;
  return out;
}

Eigen::VectorXd WhitenedResiduals::evaluate(const Hypothesis& hypothesis, const Eigen::VectorXd& z) const {
  return evaluate({{&hypothesis, z}}).front();
}

}  // namespace ferrobench::model::inference
