#include "recordings/analysis/small_signal.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "base/units.h"
#include "recordings/analysis/signals.h"

namespace ferrobench::recordings {
namespace {

using Complex = std::complex<double>;
constexpr Complex i_unit{0, 1};
constexpr double degree = std::numbers::pi / 180;
constexpr int drift = 4, terms = drift + 6;  // a cubic, and two terms for each of three harmonics
constexpr double told_from_none = 5;  // standard uncertainties: there |z| is too large by a tenth of one

// What a fit makes of one channel at one bias.
struct Fit {
  Reading cosine, sine;  // a_1 and b_1
  double deviation = 0;  // of what is left
  Complex phasor() const { return {cosine.value, -sine.value}; }
  // Re(factor Y) moves so with the samples.
  std::vector<Weight> weights(Complex factor) const {
    return (factor.real() * cosine + factor.imag() * sine).weights;
  }
};

// A channel at all biases.
class LockIn {
 public:
  LockIn(const Recording& recording, Channel channel, const std::vector<BiasSine>& sines)
      : signal_(signal(recording, channel)), time_(recording.time) {
    for (const auto& sine : sines) fits_.push_back(fit(sine));
    constexpr double scatter = 1;      // what is left is told in its own deviation
    constexpr std::size_t most = 500;  // windows, more than are needed
    QuietWindows quiet(left_time_, left_, scatter, most);
    keep_quiet(std::span(&quiet, 1));
    colour_ = colour_of(std::span(&quiet, 1));
  }

  const std::optional<Fit>& at(std::size_t sine) const { return fits_[sine]; }
  double variance(const Fit& fit, Complex factor) const {
    if (signal_.exact) return 0;
    return Noise(fit.deviation, colour_, signal_.lsb).variance(fit.weights(factor));
  }
  double gain_uncertainty() const { return signal_.gain_uncertainty; }

 private:
  std::optional<Fit> fit(const BiasSine& sine) {
    const double start = time_[sine.first], length = time_[sine.last] - start;
    const double first_cycle = start + length / sine.cycles, middle = (first_cycle + time_[sine.last]) / 2;
    std::vector<std::size_t> samples;
    for (auto i = sine.first; i <= sine.last; ++i)
      if (time_[i] >= first_cycle && std::isfinite(signal_.values[i])) samples.push_back(i);
    if (samples.size() < fewest_in_sine) return std::nullopt;
    const auto count = static_cast<Eigen::Index>(samples.size());
    Eigen::Matrix<double, Eigen::Dynamic, terms> basis(count, terms);
    Eigen::VectorXd values(count);
    for (Eigen::Index k = 0; k < count; ++k) {
      const auto i = samples[static_cast<std::size_t>(k)];
      const double w = 2 * std::numbers::pi * sine.cycles * (time_[i] - start) / length;
      const double u = (time_[i] - middle) / length;
      basis.row(k) << 1, u, u * u, u * u * u, std::cos(w), std::sin(w), std::cos(2 * w), std::sin(2 * w),
          std::cos(3 * w), std::sin(3 * w);
      values[k] = signal_.values[i];
    }
    const Eigen::Matrix<double, terms, Eigen::Dynamic> solve =
        (basis.transpose() * basis).ldlt().solve(basis.transpose());
    const Eigen::Matrix<double, terms, 1> fitted = solve * values;
    const Eigen::VectorXd left = values - basis * fitted;
    Fit out{.cosine = {fitted[drift], {}},
            .sine = {fitted[drift + 1], {}},
            .deviation = left.norm() / std::sqrt(static_cast<double>(count - terms))};
    for (Eigen::Index k = 0; k < count; ++k) {
      const auto i = samples[static_cast<std::size_t>(k)];
      out.cosine.weights.push_back({i, solve(drift, k)});
      out.sine.weights.push_back({i, solve(drift + 1, k)});
      if (!(out.deviation > 0)) continue;
      left_time_.push_back(time_[i]);
      left_.push_back(left[k] / out.deviation);
    }
    return out;
  }

  Signal signal_;
  const std::vector<double>& time_;
  std::vector<std::optional<Fit>> fits_;
  std::vector<double> left_time_, left_;  // by the fits of all biases, in deviations of each
  NoiseColour colour_;
};

// z = Y / E at one bias, and figures of it.
class Response {
 public:
  Response(const LockIn& channel, const LockIn& field, std::size_t sine)
      : channel_(channel), field_(field), y_(*channel.at(sine)), e_(*field.at(sine)) {
    z_ = y_.phasor() / e_.phasor();
    told_ = std::abs(z_) > told_from_none * noise(std::conj(z_) / std::abs(z_));
  }
  Complex z() const { return z_; }
  bool told() const { return told_; }
  // `derivative`: f' as above.
  Estimate ratio(double value, Complex derivative) const { return {value, told_ ? noise(derivative) : 0, 0}; }
  Estimate calibrated(double value, Complex derivative) const {
    auto out = ratio(value, derivative);
    if (told_)
      out.calibration = std::hypot(channel_.gain_uncertainty(), field_.gain_uncertainty()) * std::abs(value);
    return out;
  }

 private:
  double noise(Complex derivative) const {
    const auto factor = derivative / e_.phasor();
    return std::sqrt(channel_.variance(y_, factor) + field_.variance(e_, -factor * z_));
  }

  const LockIn &channel_, &field_;
  const Fit &y_, &e_;
  Complex z_;
  bool told_ = false;
};

Estimate times(Estimate e, double factor) {
  return {e.value * factor, e.noise * std::abs(factor), e.calibration * std::abs(factor)};
}

void add_charge(const Response& charge, const Specimen& specimen, SmallSignalPoint& point) {
  const auto z = charge.z();
  const auto real = charge.calibrated(z.real(), 1);
  const double area = specimen.area * static_cast<double>(specimen.layer_count);
  point.capacitance = times(real, 1 / specimen.layer_thickness);
  point.permittivity = times(real, 1 / (vacuum_permittivity * area));
  if (charge.told())
    point.tan_delta =
        charge.ratio(-z.imag() / z.real(), i_unit / z.real() + z.imag() / (z.real() * z.real()));
}

void add_displacement(const Response& displacement, const Specimen& specimen, SmallSignalPoint& point) {
  const auto z = displacement.z();
  point.d33 = times(displacement.calibrated(std::abs(z), std::conj(z) / std::abs(z)), 1 / specimen.length);
  if (!displacement.told()) return;
  auto phase = displacement.ratio(std::arg(z) / degree, -i_unit / z / degree);
  // Neither with the field nor against it lies at an end of the range.
  if (phase.value < -90) phase.value += 360;
  point.phase = phase;
}

}  // namespace

std::vector<SmallSignalPoint> find_small_signal(const Recording& r, const std::vector<BiasSine>& sines) {
  std::vector<SmallSignalPoint> out;
  const auto reference = r.has(Channel::field) ? Channel::field : Channel::command;
  if (!r.has(reference) || (!r.has(Channel::charge) && !r.has(Channel::displacement))) return out;
  if (sines.empty()) return out;
  const LockIn field(r, reference, sines);
  std::optional<LockIn> charge, displacement;
  if (r.has(Channel::charge)) charge.emplace(r, Channel::charge, sines);
  if (r.has(Channel::displacement)) displacement.emplace(r, Channel::displacement, sines);
  for (std::size_t k = 0; k < sines.size(); ++k) {
    const auto& e = field.at(k);
    if (!e || !(std::abs(e->phasor()) > 0)) continue;
    const double length = r.time[sines[k].last] - r.time[sines[k].first];
    SmallSignalPoint point{.sine = sines[k],
                           .frequency = sines[k].cycles / length,
                           .amplitude = std::abs(e->phasor()),
                           .capacitance = {},
                           .permittivity = {},
                           .tan_delta = {},
                           .d33 = {},
                           .phase = {}};
    if (charge && charge->at(k)) add_charge({*charge, field, k}, r.header.specimen, point);
    if (displacement && displacement->at(k))
      add_displacement({*displacement, field, k}, r.header.specimen, point);
    out.push_back(point);
  }
  return out;
}

}  // namespace ferrobench::recordings
