// How much of a change in the recordings is left once a fit of the base model has taken up what it can.
//
// With y the change over noise, J its slopes by the logarithms z of what recalibration may move (finite
// differences of the twin), w samples for each one that sizing keeps:
//
//   minimize  w |y - J z|^2 + sum (z_i / s_i)^2
//
// s: 12 % for the base parameters, 5 % for the factors on each recording's spring and prestress,
// 3 % for each channel's gain; each recording's offsets are taken out. What is left is the largest rms of
// y - J z over channels and recordings. Once along the way the twin is played with the z found and the rest
// projected again, as large moves are not linear.
#pragma once

#include <Eigen/Dense>

#include "tests/campaign/sizing.h"

namespace ferrobench::campaign {

class Recalibration {
 public:
  Recalibration(const Sizing& sizing, const std::array<double, 4>& noise);
  // What is there before, besides the base model; nothing at first.
  void start_from(const std::vector<model::EffectSetting>& effects);
  // Of what these bring on top of it; infinite if the twin gives up.
  double left(const std::vector<model::EffectSetting>& more) const;

 private:
  Eigen::VectorXd rows(const std::vector<Response>& played) const;
  // With z of what is simulated.
  Eigen::VectorXd moved(const Eigen::VectorXd& z) const;

  const Sizing& sizing_;
  std::array<double, 4> noise_;
  std::vector<Eigen::Index> begins_;  // of each channel of each recording, and the end
  Eigen::Index base_count_ = 0, moved_count_ = 0;
  std::vector<model::EffectSetting> before_;
  Eigen::VectorXd here_;  // before anything moves
  Eigen::MatrixXd slopes_;
  Eigen::VectorXd weight_;  // 1 / s^2
  Eigen::LDLT<Eigen::MatrixXd> normal_;
};

}  // namespace ferrobench::campaign
