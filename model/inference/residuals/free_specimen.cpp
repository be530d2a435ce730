#include "model/inference/residuals/free_specimen.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "model/on_recording.h"

namespace ferrobench::model {
namespace {

using recordings::Channel;

// Steps that a simulation may take for each knot and on top: twenty times what shipped models take. A search
// that strays into models stiffer than that turns back.
constexpr std::uint64_t steps_per_knot = 20, steps_at_least = 20000;

// min |A x - b|^2 for low <= x <= high in two unknowns: the free minimum if it is within, else the best on an
// edge.
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

class FreeSpecimen final : public Separable {
 public:
  FreeSpecimen(Model model, const std::vector<FreeParameter>& free, const std::vector<RecordingData>& data)
      : base_(std::move(model)), data_(data) {
    for (const auto& p : free) ranges_[p.path] = {p.low, p.high};
    // A nominal specimen: the kinetics depend on the groups alone.
    nominal_polarization_ = polarization().middle();
    nominal_strain_ = strain().middle();
    const double p = nominal_polarization_;
    const auto scaled = [&](const char* path, double factor) {
      const auto r = ranges_.at(path);
      return FreeParameter{path, r.low * factor, r.high * factor, true};
    };
    coordinates_.push_back(scaled("material.activation_volume", p));
    coordinates_.push_back(scaled("material.barrier", 1 / p));
    const double highest = ranges_.at("material.permittivity_180").high / p;
    coordinates_.push_back({"rho", -highest, highest, false});
    if (ranges_.contains("polycrystal.interaction_stress_std"))
      coordinates_.push_back(scaled("polycrystal.interaction_stress_std", std::abs(nominal_strain_) / p));
    for (const auto& f : free)
      if (f.path == "material.relaxation_time" || f.path == "polycrystal.barrier_log_std" ||
          f.path == "polycrystal.interaction_field_std" || f.path == "polycrystal.bias_field")
        coordinates_.push_back(f);
  }

  std::size_t dimensions() const override { return coordinates_.size(); }

  std::vector<double> place(const Model& m) const override {
    const double p = m.material.remanent_polarization;
    std::vector<double> out;
    for (const auto& c : coordinates_) {
      double value = 0;
      if (c.path == "material.activation_volume")
        value = m.material.activation_volume * p;
      else if (c.path == "material.barrier")
        value = m.material.barrier / p;
      else if (c.path == "rho")
        value = (m.material.permittivity_180 - m.material.permittivity_90) / p;
      else if (c.path == "polycrystal.interaction_stress_std")
        value = m.polycrystal.interaction_stress_std * std::abs(m.material.remanent_strain_90) / p;
      else
        value = get_parameter(m, c.path);
      out.push_back(to_unit(c, value));
    }
    return out;
  }

  std::optional<Point> at(std::span<const double> unit, const Fidelity& fidelity) const override {
    std::map<std::string, double> group;
    std::vector<std::pair<std::string, double>> plain;
    for (std::size_t i = 0; i < coordinates_.size(); ++i) {
      const auto& path = coordinates_[i].path;
      const double value = from_unit(coordinates_[i], unit[i]);
      if (path == "material.relaxation_time" || path.starts_with("polycrystal.")) {
        if (path != "polycrystal.interaction_stress_std") plain.emplace_back(path, value);
      }
      group[path] = value;
    }
    Model m = with_parameters(base_, plain);
    const double rho = group.at("rho");
    set_groups(m, group, nominal_polarization_, nominal_strain_);
    const double least = ranges_.at("material.permittivity_90").low;
    m.material.permittivity_90 = least + std::max(0.0, -rho * nominal_polarization_);
    m.material.permittivity_180 = m.material.permittivity_90 + rho * nominal_polarization_;

    Plane charge, displacement;
    for (const auto& d : data_) {
      const auto specimen = model_for(m, d.header);
      const auto s = simulate_recorded(specimen, d, fidelity);
      if (!s) return std::nullopt;
      const auto ninety = [&](std::size_t i) { return 1 - s->plus[i] - s->minus[i]; };
      const auto order = [&](std::size_t i) { return s->plus[i] - s->minus[i]; };
      const double plates = static_cast<double>(specimen.actuator.layer_count) * specimen.actuator.area;
      const double length = specimen.actuator.length;
      for (const auto& column : d.columns) {
        if (column.channel == Channel::charge)
          add(
              column, charge,
              [&](std::size_t i) { return plates * (order(i) - rho * ninety(i) * s->field[i]); },
              [&](std::size_t i) { return plates * s->field[i]; });
        if (column.channel == Channel::displacement)
          add(
              column, displacement, [&](std::size_t i) { return length * ninety(i); },
              [&](std::size_t i) { return length * order(i) * s->field[i]; });
      }
    }
    Point out{.model = m, .squares = charge.measured + displacement.measured};
    auto& material = out.model.material;
    material.remanent_polarization = base_.material.remanent_polarization;
    material.permittivity_180 = base_.material.permittivity_180;
    if (charge.measured > 0) {
      const auto kappa = ranges_.at("material.permittivity_180");
      const Eigen::Vector2d low(polarization().low, std::max(kappa.low, least)),
          high(polarization().high, kappa.high);
      const auto x = charge.within(low, high);
      out.squares += charge.squares(x) - charge.measured;
      material.remanent_polarization = x[0];
      material.permittivity_180 = x[1];
    }
    material.remanent_strain_90 = base_.material.remanent_strain_90;
    material.piezoelectric_180 = base_.material.piezoelectric_180;
    if (displacement.measured > 0) {
      const auto d = ranges_.at("material.piezoelectric_180");
      const auto x = displacement.within({strain().low, d.low}, {strain().high, d.high});
      out.squares += displacement.squares(x) - displacement.measured;
      material.remanent_strain_90 = x[0];
      material.piezoelectric_180 = x[1];
    }
    const auto kappa_90 = ranges_.at("material.permittivity_90");
    material.permittivity_90 = std::clamp(material.permittivity_180 - rho * material.remanent_polarization,
                                          kappa_90.low, kappa_90.high);
    set_groups(out.model, group, material.remanent_polarization, material.remanent_strain_90);
    return out;
  }

 private:
  Range polarization() const { return ranges_.at("material.remanent_polarization"); }
  Range strain() const { return ranges_.at("material.remanent_strain_90"); }

  static void set_groups(Model& m, const std::map<std::string, double>& group, double polarization,
                         double strain) {
    m.material.remanent_polarization = polarization;
    m.material.remanent_strain_90 = strain;
    m.material.activation_volume = group.at("material.activation_volume") / polarization;
    m.material.barrier = group.at("material.barrier") * polarization;
    if (const auto s = group.find("polycrystal.interaction_stress_std"); s != group.end())
      m.polycrystal.interaction_stress_std = s->second * polarization / std::abs(strain);
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

  Model base_;
  const std::vector<RecordingData>& data_;
  std::map<std::string, Range> ranges_;
  std::vector<FreeParameter> coordinates_;
  double nominal_polarization_ = 0, nominal_strain_ = 0;
};

}  // namespace

const std::vector<double>& SimulatedRows::at(Channel channel) const {
  if (channel == Channel::charge) return charge;
  return channel == Channel::displacement ? displacement : force;
}

double residual_scale(const MeasuredColumn& column) {
  return 100 / (column.range * std::sqrt(static_cast<double>(column.rows.size())));
}

std::optional<SimulatedRows> simulate_recorded(const Model& model, const RecordingData& data,
                                               const Fidelity& fidelity) {
  const auto& drive = fidelity.coarse ? data.simplified : data.drive;
  const auto n = data.time.size();
  SimulatedRows out;
  for (auto* column : {&out.field, &out.charge, &out.displacement, &out.force, &out.plus, &out.minus})
    column->resize(n);
  ChannelSpans spans;
  spans.field = out.field;
  spans.charge = out.charge;
  spans.displacement = out.displacement;
  spans.force = out.force;
  spans.fraction_plus = out.plus;
  spans.fraction_minus = out.minus;
  auto options = fidelity.simulation;
  if (options.most_steps == 0) options.most_steps = steps_at_least + steps_per_knot * drive.time.size();
  try {
    simulate_at(model, drive.time, drive.field, data.time, spans, options);
  } catch (const Error& e) {
    if (e.code() == ErrorCode::numerical || e.code() == ErrorCode::bad_model) return std::nullopt;
    throw;
  }
  return out;
}

std::unique_ptr<Separable> free_specimen(const Model& model, const std::vector<FreeParameter>& free,
                                         const std::vector<RecordingData>& data) {
  constexpr std::array grouped{"material.remanent_polarization",
                               "material.remanent_strain_90",
                               "material.permittivity_180",
                               "material.permittivity_90",
                               "material.piezoelectric_180",
                               "material.activation_volume",
                               "material.barrier"};
  const auto is_free = [&](std::string_view path) {
    return std::ranges::any_of(free, [&](const auto& p) { return p.path == path; });
  };
  if (!model.effects.empty() || model.polycrystal.method == PolycrystalMethod::parametrized) return nullptr;
  if (!std::ranges::all_of(grouped, is_free)) return nullptr;
  if (model.polycrystal.interaction_stress_std != 0 && !is_free("polycrystal.interaction_stress_std"))
    return nullptr;
  if (std::ranges::any_of(data, [](const auto& d) { return d.header.load.spring_stiffness != 0; }))
    return nullptr;
  return std::make_unique<FreeSpecimen>(model, free, data);
}

}  // namespace ferrobench::model
