#include "model/inference/selection/leave_one_out.h"

#include <algorithm>

namespace ferrobench::model::inference {

std::vector<double> leave_one_out_squares(const WhitenedRecordings& residuals, const Fit& fit) {
  const Eigen::MatrixXd normal = fit.normal();
  const Eigen::VectorXd gradient = fit.gradient();
  std::vector<double> out;
  for (const std::size_t recording : residuals.chosen()) {
    Eigen::Index begin = residuals.size(), end = 0;
    for (const auto& b : residuals.blocks()) {
      if (b.recording != recording) continue;
      begin = std::min(begin, b.begin);
      end = std::max(end, b.begin + b.count);
    }
    const auto jacobian = fit.jacobian.middleRows(begin, std::max<Eigen::Index>(0, end - begin));
    const auto residual = fit.residual.segment(begin, std::max<Eigen::Index>(0, end - begin));
    Eigen::MatrixXd others = normal;
    others.noalias() -= jacobian.transpose() * jacobian;
    const Eigen::VectorXd step = -others.ldlt().solve(gradient - jacobian.transpose() * residual);
    out.push_back((residual + jacobian * step).squaredNorm());
  }
  return out;
}

LeaveOneOut compare_left_out(const WhitenedRecordings& residuals, const std::vector<double>& without,
                             const Fit& with) {
  LeaveOneOut out{.recordings = without.size()};
  const auto squares = leave_one_out_squares(residuals, with);
  for (std::size_t i = 0; i < without.size(); ++i) {
    out.gain += without[i] - squares[i];
    out.better += squares[i] < without[i] ? 1 : 0;
  }
  return out;
}

}  // namespace ferrobench::model::inference
