#include "model/inference/selection/residual_basis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "model/inference/common/parallel.h"
#include "model/on_recording.h"
#include "model/physics/lag.h"

namespace ferrobench::model::inference {
namespace {

using recordings::Channel;
using Signal = std::vector<double>;

// What the fitted model does at a recording's rows.
struct States {
  Signal time, field, charge, displacement, force, stress, plus, minus;
  double stiffness = 0;  // of the spring, N/m
  double back = 1;       // displacement of an added free extension, its share
  Model model;
};

States states_of(const WhitenedRecordings& residuals, const Fit& fit, std::size_t recording) {
  const auto setting = setting_at(fit.hypothesis, fit.z);
  const auto r = apply_setting(setting, residuals.bench()[recording]);
  States s;
  s.model = model_for(setting.model, r.header);
  s.time = r.time;
  auto options = residuals.simulation();
  options.past = &r.header.past;
  for (auto* column : {&s.field, &s.charge, &s.displacement, &s.force, &s.stress, &s.plus, &s.minus})
    column->resize(r.time.size());
  simulate_at(s.model, r.knot_time, r.knot_field, r.time,
              {.field = s.field,
               .charge = s.charge,
               .displacement = s.displacement,
               .force = s.force,
               .polarization = {},
               .strain = {},
               .stress = s.stress,
               .fraction_plus = s.plus,
               .fraction_minus = s.minus},
              options);
  s.stiffness = r.header.load.spring_stiffness;
  const auto& a = s.model.actuator;
  s.back = 1 / (1 + s.stiffness * s.model.material.compliance_180 * a.length / a.area);
  return s;
}

Signal lagged(const Signal& u, const Signal& t, double tau) {
  Signal out(u.size(), u.front());
  for (std::size_t i = 1; i < u.size(); ++i) out[i] = lag(out[i - 1], u[i - 1], u[i], t[i] - t[i - 1], tau);
  return out;
}

Signal map(const Signal& u, double (*f)(double)) {
  Signal out(u.size());
  double largest = 1e-300;
  for (const double v : u) largest = std::max(largest, std::abs(v));
  for (std::size_t i = 0; i < u.size(); ++i) out[i] = f(u[i] / largest);
  return out;
}
double square(double v) {
  return v * v;
}
double cube(double v) {
  return v * v * v;
}
double same(double v) {
  return v;
}
double magnitude(double v) {
  return std::abs(v);
}

// Dahl's sliding state: which way it went last, over a twentieth of the range.
Signal sliding(const Signal& x) {
  const auto [low, high] = std::ranges::minmax(x);
  const double distance = 0.05 * (high - low) + 1e-300;
  Signal out(x.size(), 0.0);
  for (std::size_t i = 1; i < x.size(); ++i) {
    const double moved = x[i] - x[i - 1], end = moved > 0 ? 1 : moved < 0 ? -1 : out[i - 1];
    out[i] = end + (out[i - 1] - end) * std::exp(-std::abs(moved) / distance);
  }
  return out;
}

Signal integral(const Signal& u, const Signal& t) {
  Signal out(u.size(), 0.0);
  for (std::size_t i = 1; i < u.size(); ++i)
    out[i] = out[i - 1] + 0.5 * (u[i] + u[i - 1]) * (t[i] - t[i - 1]);
  return map(out, same);
}

constexpr std::array<double, 3> lag_times{0.01, 0.2, 4};  // s

void add_lags(std::vector<Signal>& out, const Signal& u, const Signal& t) {
  for (const double tau : lag_times) out.push_back(lagged(map(u, same), t, tau));
}

// By channel, functions in the same order for each; an empty one is zero.
using Functions = std::map<Channel, std::vector<Signal>>;

Functions functions_of(Family family, const States& s) {
  std::vector<Signal> f;
  const auto sensor = [&](const Signal& u) {
    f = {map(s.time, same),  map(u, square), map(u, cube),
         map(s.field, same), sliding(u),     integral(u, s.time)};
    add_lags(f, u, s.time);
  };
  const auto scaled = [](const Signal& u, double by) {
    Signal out(u);
    for (double& v : out) v *= by;
    return out;
  };
  switch (family) {
    case Family::drive:
      sensor(s.field);
      return {{Channel::field, f}};
    case Family::charge_sensor:
      sensor(s.charge);
      return {{Channel::charge, f}};
    case Family::polarization:
      f = {map(s.field, cube), map(s.field, square), map(s.field, magnitude), integral(s.field, s.time)};
      add_lags(f, s.field, s.time);
      return {{Channel::charge, f}};
    case Family::displacement_sensor:
      sensor(s.displacement);
      return {{Channel::displacement, f}};
    case Family::force_sensor:
      sensor(s.force);
      return {{Channel::force, f}};
    case Family::strain: {
      f = {map(s.field, square), map(s.field, cube), map(s.field, magnitude), map(s.stress, square),
           sliding(s.stress)};
      add_lags(f, s.field, s.time);
      add_lags(f, s.stress, s.time);
      add_lags(f, map(s.field, square), s.time);
      Functions out;
      for (const auto& u : f) {
        out[Channel::displacement].push_back(scaled(u, s.back));
        out[Channel::force].push_back(scaled(u, s.back * s.stiffness));
      }
      return out;
    }
    case Family::equilibrium: {
      f = {map(s.displacement, square), map(s.displacement, cube), sliding(s.displacement),
           map(s.time, same)};
      add_lags(f, s.displacement, s.time);
      // A force besides the spring's: on the load cell it shows or not, the displacement gives way.
      const double compliance =
          s.back * s.model.material.compliance_180 * s.model.actuator.length / s.model.actuator.area;
      Functions out;
      for (const auto& u : f) {
        out[Channel::displacement].push_back(scaled(u, -compliance));
        out[Channel::force].push_back(scaled(u, s.back));
        out[Channel::displacement].push_back(scaled(u, -compliance));
        out[Channel::force].push_back(scaled(u, -compliance * s.stiffness));
      }
      return out;
    }
    case Family::kinetics:
      break;
  }
  const auto& m = s.model;
  const double per_polarization =
      m.actuator.area * static_cast<double>(m.actuator.layer_count) * m.material.remanent_polarization;
  const double per_strain = m.material.remanent_strain_90 * m.actuator.length * s.back;
  Signal order(s.plus), ninety(s.plus);
  for (std::size_t i = 0; i < order.size(); ++i) {
    order[i] = s.plus[i] - s.minus[i];
    ninety[i] = 1 - s.plus[i] - s.minus[i];
  }
  Functions out;
  const auto add = [&](const Signal& p, const Signal& n) {
    out[Channel::charge].push_back(scaled(p, per_polarization));
    out[Channel::displacement].push_back(scaled(n, per_strain));
    out[Channel::force].push_back(scaled(n, per_strain * s.stiffness));
  };
  add(order, ninety);
  for (const double tau : {0.003, 0.03, 0.3, 3.0})
    add(lagged(order, s.time, tau), lagged(ninety, s.time, tau));
  add(map(order, square), map(ninety, square));
  add(map(order, cube), map(ninety, cube));
  return out;
}

}  // namespace

BasisFit fit_residual_basis(const WhitenedRecordings& residuals, const Fit& fit,
                            std::optional<recordings::Channel> acted_on) {
  std::map<std::size_t, States> states;
  for (const std::size_t r : residuals.chosen()) states.emplace(r, States{});
  std::vector<std::size_t> order(residuals.chosen());
  in_parallel(order.size(), residuals.threads(),
              [&](std::size_t i) { states.at(order[i]) = states_of(residuals, fit, order[i]); });
  constexpr std::array families{
      Family::drive,        Family::charge_sensor, Family::polarization, Family::displacement_sensor,
      Family::force_sensor, Family::strain,        Family::equilibrium,  Family::kinetics};
  std::vector<BasisFit> found(families.size());
  in_parallel(families.size(), residuals.threads(), [&](std::size_t k) {
    const Family family = families.at(k);
    std::map<std::size_t, Functions> functions;
    for (const auto& [r, s] : states) functions.emplace(r, functions_of(family, s));
    if (acted_on &&
        std::ranges::none_of(functions, [&](const auto& f) { return f.second.contains(*acted_on); })) {
      found[k].beyond_chance = -std::numeric_limits<double>::infinity();
      return;
    }
    std::size_t count = 0;
    for (const auto& [r, f] : functions)
      for (const auto& [channel, list] : f) count = std::max(count, list.size());
    Eigen::MatrixXd basis = Eigen::MatrixXd::Zero(residuals.size(), static_cast<Eigen::Index>(count));
    for (const auto& block : residuals.blocks()) {
      const auto channel = residuals.bench()[block.recording].channels[block.channel].channel;
      const auto& f = functions.at(block.recording);
      const auto list = f.find(channel);
      if (list == f.end()) continue;
      for (std::size_t i = 0; i < list->second.size(); ++i)
        basis.col(static_cast<Eigen::Index>(i)).segment(block.begin, block.count) =
            residuals.whiten(block, list->second[i]);
    }
    for (Eigen::Index i = 0; i < basis.cols(); ++i) residuals.marginalize(basis.col(i));
    found[k].family = family;
    // Of equal weight, and without what the parameters can do as well.
    Eigen::MatrixXd gram(count, count);
    Eigen::VectorXd along(count);
    std::vector<Eigen::Index> used;
    std::vector<double> norms;
    for (Eigen::Index i = 0; i < basis.cols(); ++i) {
      norms.push_back(basis.col(i).norm());
      if (norms.back() > 0) basis.col(i) /= norms.back();
      if (norms.back() > 0) used.push_back(i);
    }
    Eigen::MatrixXd kept(residuals.size(), static_cast<Eigen::Index>(used.size()));
    for (std::size_t i = 0; i < used.size(); ++i) kept.col(static_cast<Eigen::Index>(i)) = basis.col(used[i]);
    if (used.empty()) return;
    const Eigen::MatrixXd shared = fit.jacobian.transpose() * kept;
    const Eigen::MatrixXd taken = fit.normal().ldlt().solve(shared);
    gram = kept.transpose() * kept - shared.transpose() * taken;
    along = kept.transpose() * fit.residual - taken.transpose() * fit.gradient();
    Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(gram);
    const double smallest = 1e-6 * std::max(1e-12, eigen.eigenvalues().maxCoeff());
    Eigen::VectorXd weights = Eigen::VectorXd::Zero(gram.cols());
    for (Eigen::Index i = 0; i < gram.cols(); ++i) {
      if (eigen.eigenvalues()[i] < smallest) continue;
      const double part = eigen.eigenvectors().col(i).dot(along);
      weights += part / eigen.eigenvalues()[i] * eigen.eigenvectors().col(i);
      found[k].drop += part * part / eigen.eigenvalues()[i];
      ++found[k].functions;
    }
    found[k].weights.assign(norms.size(), 0);
    for (std::size_t i = 0; i < used.size(); ++i)
      found[k].weights[static_cast<std::size_t>(used[i])] =
          weights[static_cast<Eigen::Index>(i)] / norms[static_cast<std::size_t>(used[i])];
    found[k].beyond_chance = found[k].drop - found[k].functions - 3 * std::sqrt(2.0 * found[k].functions);
  });
  return *std::ranges::max_element(found, {}, &BasisFit::beyond_chance);
}

std::vector<MissingSignal> reconstruct_signals(const WhitenedRecordings& residuals, const Fit& fit,
                                               const BasisFit& explained) {
  struct Found {
    MissingSignal signal;
    double over_noise = 0;
  };
  std::map<Channel, Found> worst;
  for (const std::size_t r : residuals.chosen()) {
    const auto functions = functions_of(explained.family, states_of(residuals, fit, r));
    const auto& recording = residuals.bench()[r];
    for (std::size_t c = 0; c < recording.channels.size(); ++c) {
      const auto list = functions.find(recording.channels[c].channel);
      if (list == functions.end()) continue;
      Signal sum(recording.time.size(), 0.0);
      for (std::size_t i = 0; i < std::min(list->second.size(), explained.weights.size()); ++i)
        for (std::size_t row = 0; row < sum.size(); ++row)
          sum[row] += explained.weights[i] * list->second[i][row];
      // An offset is nobody's signal.
      double mean = 0;
      for (const double v : sum) mean += v / static_cast<double>(sum.size());
      for (double& v : sum) v -= mean;
      double square = 0;
      for (const double v : sum) square += v * v;
      const double over_noise =
          std::sqrt(square / static_cast<double>(sum.size())) / residuals.noise_of(r, c);
      auto& place = worst[recording.channels[c].channel];
      if (over_noise <= place.over_noise) continue;
      place.over_noise = over_noise;
      place.signal = {.recording = recording.name,
                      .channel = recording.channels[c].channel,
                      .time = recording.time,
                      .value = std::move(sum)};
    }
  }
  std::vector<Found> sorted;
  sorted.reserve(worst.size());
  for (auto& [channel, f] : worst) sorted.push_back(std::move(f));
  std::ranges::stable_sort(sorted, std::greater<>(), &Found::over_noise);
  std::vector<MissingSignal> out;
  out.reserve(sorted.size());
  for (auto& f : sorted) out.push_back(std::move(f.signal));
  return out;
}

}  // namespace ferrobench::model::inference
