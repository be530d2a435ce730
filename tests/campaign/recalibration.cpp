#include "tests/campaign/recalibration.h"

#include <limits>

#include "tests/campaign/base_models.h"

namespace ferrobench::campaign {
namespace {

// Small against the priors, large against what single domains do.
constexpr double finite_step = 0.02;
constexpr double base_std = 0.12, load_std = 0.05, gain_std = 0.03;

}  // namespace

// Columns: base parameters (without a slope those that are absent), then spring and prestress of each
// recording, then the channels' gains.
Recalibration::Recalibration(const Sizing& sizing, const std::array<double, 4>& noise)
    : sizing_(sizing), noise_(noise) {
  const auto channels = sizing.channels();
  begins_ = {0};
  for (const auto& p : sizing.programs())
    for (std::size_t c = 0; c < channels.size(); ++c)
      begins_.push_back(begins_.back() + static_cast<Eigen::Index>(p.time.size()));
  const auto recordings = static_cast<Eigen::Index>(sizing.programs().size());
  auto base = sizing.base();
  base_count_ = static_cast<Eigen::Index>(base_parameters(base).size());
  const bool loaded = base.load.spring_stiffness != 0;
  moved_count_ = base_count_ + (loaded ? 2 * recordings : 0);
  const auto gains = static_cast<Eigen::Index>(channels.size());
  slopes_ = Eigen::MatrixXd::Zero(begins_.back(), moved_count_ + gains);
  weight_ = Eigen::VectorXd::Constant(slopes_.cols(), 1 / (base_std * base_std));
  weight_.segment(base_count_, moved_count_ - base_count_).setConstant(1 / (load_std * load_std));
  weight_.tail(gains).setConstant(1 / (gain_std * gain_std));

  here_ = rows(sizing.play_all({}));
  const auto slope = [&](const Eigen::VectorXd& z) {
    return Eigen::VectorXd((moved(z) - here_) / finite_step);
  };
  Eigen::VectorXd z = Eigen::VectorXd::Zero(moved_count_);
  for (Eigen::Index k = 0; k < base_count_; ++k) {
    z[k] = finite_step;
    slopes_.col(k) = slope(z);
    z[k] = 0;
  }
  for (Eigen::Index kind = 0; loaded && kind < 2; ++kind) {
    for (Eigen::Index r = 0; r < recordings; ++r) z[base_count_ + 2 * r + kind] = finite_step;
    const auto all = slope(z);
    z.setZero();
    for (Eigen::Index r = 0; r < recordings; ++r) {
      const auto begin = begins_[static_cast<std::size_t>(r * gains)];
      const auto count = begins_[static_cast<std::size_t>((r + 1) * gains)] - begin;
      slopes_.col(base_count_ + 2 * r + kind).segment(begin, count) = all.segment(begin, count);
    }
  }
  for (std::size_t block = 0; block + 1 < begins_.size(); ++block) {
    const auto count = begins_[block + 1] - begins_[block];
    slopes_.col(moved_count_ + static_cast<Eigen::Index>(block % channels.size()))
        .segment(begins_[block], count) = here_.segment(begins_[block], count);
  }
  Eigen::MatrixXd normal = Sizing::thinning * slopes_.transpose() * slopes_;
  normal.diagonal() += weight_;
  normal_.compute(normal);
}

// Over noise, each channel of each recording without its mean.
Eigen::VectorXd Recalibration::rows(const std::vector<Response>& played) const {
  Eigen::VectorXd out(begins_.back());
  std::size_t block = 0;
  for (const auto& response : played)
    for (const auto c : sizing_.channels()) {
      const auto& column = *columns(response).at(c);
      const auto n = static_cast<Eigen::Index>(column.size());
      const Eigen::Map<const Eigen::VectorXd> values(column.data(), n);
      out.segment(begins_[block++], n) = (values.array() - values.mean()) / noise_.at(c);
    }
  return out;
}

void Recalibration::start_from(const std::vector<model::EffectSetting>& effects) {
  before_ = effects;
  here_ = rows(sizing_.play_all(effects));
}

Eigen::VectorXd Recalibration::moved(const Eigen::VectorXd& z) const {
  auto base = sizing_.base();
  Eigen::Index k = 0;
  for (auto* value : base_parameters(base)) *value *= std::exp(z[k++]);
  auto programs = sizing_.programs();
  if (moved_count_ > base_count_)
    for (auto& p : programs) {
      p.spring *= std::exp(z[k++]);
      p.prestress *= std::exp(z[k++]);
    }
  return rows(sizing_.play_all(base, programs, before_));
}

double Recalibration::left(const std::vector<model::EffectSetting>& more) const {
  try {
    auto all = before_;
    all.insert(all.end(), more.begin(), more.end());
    const Eigen::VectorXd target = rows(sizing_.play_all(all));
    Eigen::VectorXd at = Eigen::VectorXd::Zero(slopes_.cols()), rest = target - here_;
    const auto project = [&] {
      Eigen::VectorXd pull = weight_.cwiseProduct(at);
      pull.tail(slopes_.cols() - moved_count_).setZero();  // gains are not simulated
      const Eigen::VectorXd step = normal_.solve(Sizing::thinning * slopes_.transpose() * rest - pull);
      rest -= slopes_ * step;
      at += step;
    };
    project();
    rest = target - moved(at.head(moved_count_));
    project();
    double largest = 0;
    for (std::size_t block = 0; block + 1 < begins_.size(); ++block) {
      const auto count = begins_[block + 1] - begins_[block];
      const double mean_square =
          rest.segment(begins_[block], count).squaredNorm() / static_cast<double>(count);
      largest = std::max(largest, std::sqrt(mean_square));
    }
    return largest;
  } catch (const Error&) {
    return std::numeric_limits<double>::infinity();
  }
}

}  // namespace ferrobench::campaign
