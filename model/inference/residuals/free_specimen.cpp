#include "model/inference/residuals/free_specimen.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include "model/effects/catalogue.h"
#include "model/inference/parameters/parameters.h"
#include "model/on_recording.h"

namespace ferrobench::model {
namespace {

using recordings::Channel;

// Eliminated, or part of a group: all of them must be free, those of the strain where it shows.
constexpr std::array grouped{"material.remanent_polarization", "material.permittivity_180",
                             "material.permittivity_90", "material.activation_volume", "material.barrier"};
constexpr std::array of_strain{"material.remanent_strain_90", "material.piezoelectric_180"};
// Searched as they are, where they are free.
constexpr std::array plain{"material.relaxation_time", "polycrystal.barrier_log_std",
                           "polycrystal.interaction_field_std", "polycrystal.bias_field"};
constexpr auto stress_spread = "polycrystal.interaction_stress_std";

// Whether an effect changes what the rates see and nothing of what enters linearly.
bool is_of_rates(const EffectSetting& setting) {
  const auto& effect = find_effect(setting.id);
  return effect.family == Family::kinetics && !effect.table;
}
// Parameters of effects that are searched, by path: those whose product with P is a group, and the others.
std::vector<std::string> effect_paths(const Model& model, bool times_polarization) {
  std::vector<std::string> out;
  for (const auto& setting : model.effects)
    for (const auto& p : find_effect(setting.id).parameters)
      if (p.times_polarization == times_polarization) out.push_back(effect_path(setting.id, p.name));
  return out;
}

// |A x - b|^2 of two unknowns.
struct Plane {
  Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();    // A^T A
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();  // A^T b
  double measured = 0;                                 // b^T b

  void add(double f, double g, double b) {
    normal(0, 0) += f * f;
    normal(0, 1) += f * g;
    normal(1, 1) += g * g;
    gradient += b * Eigen::Vector2d(f, g);
    measured += b * b;
  }
  double squares(const Eigen::Vector2d& x) const {
    const double cross = normal(0, 1) * x[0] * x[1];
    return measured - 2 * gradient.dot(x) + normal(0, 0) * x[0] * x[0] + 2 * cross +
           normal(1, 1) * x[1] * x[1];
  }
  // The x of the least squares with low <= x <= high: the free minimum if it is within, else the best on an
  // edge.
  Eigen::Vector2d within(const Eigen::Vector2d& low, const Eigen::Vector2d& high) const {
    const double a = normal(0, 0), b = normal(0, 1), c = normal(1, 1), determinant = a * c - b * b;
    std::vector<Eigen::Vector2d> places;
    if (determinant > 1e-12 * a * c) {
      Eigen::Vector2d x((c * gradient[0] - b * gradient[1]) / determinant,
                        (a * gradient[1] - b * gradient[0]) / determinant);
      if ((x.array() >= low.array()).all() && (x.array() <= high.array()).all()) return x;
    }
    for (const double x : {low[0], high[0]})
      places.emplace_back(x, std::clamp(c > 0 ? (gradient[1] - b * x) / c : low[1], low[1], high[1]));
    for (const double y : {low[1], high[1]})
      places.emplace_back(std::clamp(a > 0 ? (gradient[0] - b * y) / a : low[0], low[0], high[0]), y);
    return *std::ranges::min_element(places, {}, [&](const auto& x) { return squares(x); });
  }
};

struct Range {
  double low = 0, high = 0;
  double middle() const { return std::copysign(std::sqrt(low * high), low); }  // geometric
};

// What the kinetics depend on (separable.h).
struct Groups {
  double volume = 0;           // V P, C m
  double barrier = 0;          // barrier / P, V/m
  double rho = 0;              // (kappa_180 - kappa_90) / P, m/V
  double stress = 0;           // s_std |eps_90| / P, V/m
  std::vector<double> fields;  // of effects, coefficient * P
};

Groups groups_of(const Model& model) {
  const auto& m = model.material;
  const double p = m.remanent_polarization;
  Groups out{m.activation_volume * p,
             m.barrier / p,
             (m.permittivity_180 - m.permittivity_90) / p,
             model.polycrystal.interaction_stress_std * std::abs(m.remanent_strain_90) / p,
             {}};
  for (const auto& path : effect_paths(model, true)) out.fields.push_back(get_parameter(model, path) * p);
  return out;
}

// Gives a model whose polarization and strain are set the groups of before, all but rho.
void set_groups(Model& model, const Groups& groups) {
  auto& m = model.material;
  m.activation_volume = groups.volume / m.remanent_polarization;
  m.barrier = groups.barrier * m.remanent_polarization;
  model.polycrystal.interaction_stress_std =
      groups.stress * m.remanent_polarization / std::abs(m.remanent_strain_90);
  const auto paths = effect_paths(model, true);
  for (std::size_t i = 0; i < paths.size(); ++i)
    set_parameter(model, paths[i], groups.fields[i] / m.remanent_polarization);
}

class FreeSpecimen final : public Separable {
 public:
  FreeSpecimen(Model model, const std::vector<FreeParameter>& free, const std::vector<RecordingData>& data)
      : base_(std::move(model)), data_(data) {
    for (const auto* path : of_strain)
      ranges_[path] = {get_parameter(base_, path), get_parameter(base_, path)};
    for (const auto& p : free) ranges_[p.path] = {p.low, p.high};
    // A nominal specimen: the kinetics depend on the groups alone.
    nominal_ = base_;
    nominal_.material.remanent_polarization = ranges_.at("material.remanent_polarization").middle();
    nominal_.material.remanent_strain_90 = ranges_.at("material.remanent_strain_90").middle();
    const double p = nominal_.material.remanent_polarization;
    const auto scaled = [&](const char* path, double factor) {
      const auto r = ranges_.at(path);
      return FreeParameter{path, r.low * factor, r.high * factor, true};
    };
    coordinates_ = {scaled("material.activation_volume", p), scaled("material.barrier", 1 / p)};
    const double highest = ranges_.at("material.permittivity_180").high / p;
    coordinates_.push_back({"rho", -highest, highest, false});
    if (ranges_.contains(stress_spread))
      coordinates_.push_back(scaled(stress_spread, std::abs(nominal_.material.remanent_strain_90) / p));
    first_field_ = coordinates_.size();
    for (const auto& path : effect_paths(base_, true)) {
      const auto r = *std::ranges::find(free, path, &FreeParameter::path);
      coordinates_.push_back({path, r.low * p, r.high * p, r.logarithmic});
    }
    first_plain_ = coordinates_.size();
    const auto shapes = effect_paths(base_, false);
    for (const auto& f : free)
      if (std::ranges::find(plain, f.path) != plain.end() ||
          std::ranges::find(shapes, f.path) != shapes.end())
        coordinates_.push_back(f);
  }

  std::size_t dimensions() const override { return coordinates_.size(); }

  std::vector<double> place(const Model& m) const override {
    const auto g = groups_of(m);
    std::vector<double> values{g.volume, g.barrier, g.rho, g.stress};
    values.resize(first_field_);
    values.insert(values.end(), g.fields.begin(), g.fields.end());
    for (std::size_t i = first_plain_; i < coordinates_.size(); ++i)
      values.push_back(get_parameter(m, coordinates_[i].path));
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = to_unit(coordinates_[i], values[i]);
    return values;
  }

  std::optional<Point> at(std::span<const double> unit, const Fidelity& fidelity) const override {
    const auto value = [&](std::size_t i) { return from_unit(coordinates_[i], unit[i]); };
    Groups groups{value(0), value(1), value(2), first_field_ > 3 ? value(3) : 0, {}};
    for (std::size_t i = first_field_; i < first_plain_; ++i) groups.fields.push_back(value(i));
    Model m = nominal_;
    for (std::size_t i = first_plain_; i < coordinates_.size(); ++i)
      set_parameter(m, coordinates_[i].path, value(i));
    set_groups(m, groups);
    const auto kappa_180 = ranges_.at("material.permittivity_180");
    const auto set_permittivity = [&](Material& material) {
      material.permittivity_180 =
          std::clamp(material.permittivity_90 + groups.rho * material.remanent_polarization, kappa_180.low,
                     kappa_180.high);
    };
    // Enough for both permittivities to be positive: the fractions depend on their difference alone.
    m.material.permittivity_90 =
        std::max(0.0, -groups.rho * m.material.remanent_polarization) + kappa_180.low;
    set_permittivity(m.material);

    Plane charge, displacement;
    if (!planes(m, groups.rho, fidelity, charge, displacement)) return std::nullopt;
    Point out{.model = m};
    auto& material = out.model.material;
    const auto best = [&](const Plane& plane, const char* first, const char* second, double& a, double& b) {
      const auto x_range = ranges_.at(first), y_range = ranges_.at(second);
      const auto x = plane.within({x_range.low, y_range.low}, {x_range.high, y_range.high});
      out.squares += plane.squares(x);
      a = x[0];
      b = x[1];
    };
    if (charge.measured == 0) {
      material.remanent_polarization = base_.material.remanent_polarization;
      material.permittivity_90 = base_.material.permittivity_90;
    } else {
      best(charge, "material.remanent_polarization", "material.permittivity_90",
           material.remanent_polarization, material.permittivity_90);
    }
    if (displacement.measured == 0) {
      material.remanent_strain_90 = base_.material.remanent_strain_90;
      material.piezoelectric_180 = base_.material.piezoelectric_180;
    } else {
      best(displacement, "material.remanent_strain_90", "material.piezoelectric_180",
           material.remanent_strain_90, material.piezoelectric_180);
    }
    set_permittivity(material);
    set_groups(out.model, groups);
    return out;
  }

 private:
  // False where the model could not be simulated.
  bool planes(const Model& m, double rho, const Fidelity& fidelity, Plane& charge,
              Plane& displacement) const {
    const auto simulated = simulate_each_recorded(m, data_, fidelity);
    for (std::size_t k = 0; k < data_.size(); ++k) {
      const auto& d = data_[k];
      const auto& s = simulated[k];
      if (!s) return false;
      const auto specimen = model_for(m, d.header);
      const auto ninety = [&](std::size_t i) { return 1 - s->plus[i] - s->minus[i]; };
      const auto order = [&](std::size_t i) { return s->plus[i] - s->minus[i]; };
      const double plates = static_cast<double>(specimen.actuator.layer_count) * specimen.actuator.area;
      const double length = specimen.actuator.length;
      for (const auto& column : d.columns) {
        if (column.channel == Channel::charge)
          add(
              column, charge,
              [&](std::size_t i) { return plates * (order(i) + rho * (1 - ninety(i)) * s->field[i]); },
              [&](std::size_t i) { return plates * s->field[i]; });
        if (column.channel == Channel::displacement)
          add(
              column, displacement, [&](std::size_t i) { return length * ninety(i); },
              [&](std::size_t i) { return length * order(i) * s->field[i]; });
      }
    }
    return true;
  }

  // A column's rows of two functions and what was measured, all less their means.
  template <class First, class Second>
  static void add(const MeasuredColumn& column, Plane& plane, const First& first, const Second& second) {
    const auto n = static_cast<double>(column.rows.size());
    double mean_first = 0, mean_second = 0;
    for (const auto row : column.rows) {
      mean_first += first(row) / n;
      mean_second += second(row) / n;
    }
    const double scale = residual_scale(column);
    for (std::size_t k = 0; k < column.rows.size(); ++k)
      plane.add(scale * (first(column.rows[k]) - mean_first), scale * (second(column.rows[k]) - mean_second),
                scale * column.value[k]);
  }

  Model base_, nominal_;
  const std::vector<RecordingData>& data_;
  std::map<std::string, Range> ranges_;
  std::vector<FreeParameter> coordinates_;  // the groups, then what is searched as it is
  std::size_t first_field_ = 0, first_plain_ = 0;
};

}  // namespace

std::unique_ptr<Separable> free_specimen(const Model& model, const std::vector<FreeParameter>& free,
                                         const std::vector<RecordingData>& data) {
  const auto is_free = [&](std::string_view path) {
    return std::ranges::any_of(free, [&](const auto& p) { return p.path == path; });
  };
  if (!std::ranges::all_of(model.effects, is_of_rates) ||
      model.polycrystal.method == PolycrystalMethod::parametrized)
    return nullptr;
  if (!std::ranges::all_of(grouped, is_free) || !std::ranges::all_of(effect_paths(model, true), is_free))
    return nullptr;
  if (evidence_of(data).shows_elasticity && !std::ranges::all_of(of_strain, is_free)) return nullptr;
  if (model.material.remanent_strain_90 == 0) return nullptr;  // a group has it in its denominator
  if (model.polycrystal.interaction_stress_std != 0 && !is_free(stress_spread)) return nullptr;
  if (std::ranges::any_of(data, [](const auto& d) { return d.header.load.spring_stiffness != 0; }))
    return nullptr;
  return std::make_unique<FreeSpecimen>(model, free, data);
}

}  // namespace ferrobench::model
