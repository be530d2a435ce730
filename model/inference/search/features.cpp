#include "model/inference/search/features.h"

#include <algorithm>
#include <cmath>

#include "model/physics/wells.h"

namespace ferrobench::model {
namespace {

using recordings::Channel;

struct Loop {
  double coercive = 0, bias = 0;  // V/m
  double width = 0;               // V/m, from a quarter to three quarters of the switching
  double time = 0;                // s, in which the field goes through a tenth of the coercive field
  double polarization = 0;        // C/m^2
  double permittivity = 0;        // F/m
  std::optional<double> strain_90, piezoelectric;
};

// Share of the domains at the bottom of the displacement's loop; the rest has gone on, or not gone yet.
constexpr double in_the_90_well = 0.25;

double field_at(const Drive& drive, double time) {
  const auto above = std::ranges::upper_bound(drive.time, time);
  if (above == drive.time.begin()) return drive.field.front();
  if (above == drive.time.end()) return drive.field.back();
  const auto i = static_cast<std::size_t>(above - drive.time.begin());
  const double u = (time - drive.time[i - 1]) / (drive.time[i] - drive.time[i - 1]);
  return drive.field[i - 1] + u * (drive.field[i] - drive.field[i - 1]);
}

// A channel against the field at its rows.
struct Curve {
  std::vector<double> time, field, value;

  Curve(const RecordingData& data, const MeasuredColumn& column) : value(column.value) {
    for (const auto row : column.rows) {
      time.push_back(data.time[row]);
      field.push_back(field_at(data.drive, data.time[row]));
    }
  }
  bool rises(std::size_t i) const { return field[i + 1] > field[i]; }
  // The field where the value passes `level` while the field rises or falls; last of all.
  std::optional<double> field_where(double level, bool rising, double* rate = nullptr) const {
    std::optional<double> found;
    for (std::size_t i = 0; i + 1 < value.size(); ++i) {
      if (rises(i) != rising || (value[i] < level) == (value[i + 1] < level)) continue;
      found = field[i] + (field[i + 1] - field[i]) * (level - value[i]) / (value[i + 1] - value[i]);
      if (rate != nullptr) *rate = std::abs(field[i + 1] - field[i]) / (time[i + 1] - time[i]);
    }
    return found;
  }
  std::optional<double> value_at_zero_field(bool rising) const {
    std::optional<double> found;
    for (std::size_t i = 0; i + 1 < value.size(); ++i)
      if (rises(i) == rising && (field[i] < 0) != (field[i + 1] < 0))
        found = value[i] + (value[i + 1] - value[i]) * -field[i] / (field[i + 1] - field[i]);
    return found;
  }
  // d value / d field on the way down from the largest field, over its upper third.
  double slope_at_the_top() const {
    const double top = *std::ranges::max_element(field);
    double n = 0, e = 0, v = 0, ee = 0, ev = 0;
    for (std::size_t i = 0; i + 1 < value.size(); ++i)
      if (!rises(i) && field[i] > 2 * top / 3) {
        n += 1;
        e += field[i];
        v += value[i];
        ee += field[i] * field[i];
        ev += field[i] * value[i];
      }
    const double spread = n * ee - e * e;
    return spread > 0 ? (n * ev - e * v) / spread : 0;
  }
};

std::optional<Loop> loop_of(const RecordingData& data) {
  const auto find = [&](Channel channel) {
    return std::ranges::find(data.columns, channel, &MeasuredColumn::channel);
  };
  const auto charge = find(Channel::charge), displacement = find(Channel::displacement);
  if (charge == data.columns.end()) return std::nullopt;
  const Curve q(data, *charge);
  const auto [low, high] = std::ranges::minmax(q.value);
  const auto level = [low = low, high = high](double share) { return low + share * (high - low); };
  Loop out;
  double rate = 0;
  const auto down = q.field_where(level(0.5), false), up = q.field_where(level(0.5), true, &rate);
  if (!down || !up || *up <= *down || rate <= 0) return std::nullopt;
  out.coercive = 0.5 * (*up - *down);
  out.bias = -0.5 * (*up + *down);
  out.time = 0.1 * out.coercive / rate;
  const auto quarter = q.field_where(level(0.25), true), three = q.field_where(level(0.75), true);
  out.width = quarter && three ? std::max(0.0, *three - *quarter) : 0;
  const auto& specimen = data.header.specimen;
  const double plates = static_cast<double>(specimen.layer_count) * specimen.area;
  const auto after_top = q.value_at_zero_field(false), after_bottom = q.value_at_zero_field(true);
  out.polarization = 0.5 * (after_top && after_bottom ? *after_top - *after_bottom : high - low) / plates;
  out.permittivity = q.slope_at_the_top() / plates;
  if (displacement != data.columns.end()) {
    const Curve x(data, *displacement);
    out.piezoelectric = x.slope_at_the_top() / specimen.length;
    if (const auto rest = x.value_at_zero_field(false))
      out.strain_90 = -(*rest - *std::ranges::min_element(x.value)) / (in_the_90_well * specimen.length);
  }
  return out;
}

// 4 dg0 / P_r and V dg0 / (k T).
struct Barrier {
  double field = 0, over_thermal = 0;
};

// By the loops of the highest and the lowest rate; with one rate `over_thermal` stays what it was.
Barrier barrier_of(const std::vector<Loop>& loops, double relaxation_time, double over_thermal) {
  const auto [fast, slow] = std::ranges::minmax(loops, {}, &Loop::time);
  constexpr double least = 1;  // of ln(t / tau): a domain that has no time has no coercive field of its own
  const auto attempts = [&](const Loop& l) { return std::max(least, std::log(l.time / relaxation_time)); };
  const double r = std::sqrt(attempts(fast) / attempts(slow));
  if (r < 0.98) {
    const double field = (fast.coercive - r * slow.coercive) / (1 - r);
    const double lowered = 1 - slow.coercive / field;
    if (field > fast.coercive && lowered > 0) return {field, attempts(slow) / (lowered * lowered)};
  }
  const double lowered = std::min(0.9, std::sqrt(attempts(slow) / over_thermal));
  return {slow.coercive / (1 - lowered), over_thermal};
}

}  // namespace

std::optional<Model> start_from_features(const Model& start, const std::vector<FreeParameter>& free,
                                         std::span<const RecordingData> data) {
  std::vector<Loop> loops;
  for (const auto& d : data)
    if (const auto loop = loop_of(d)) loops.push_back(*loop);
  if (loops.empty()) return std::nullopt;
  Model out = start;
  const auto set = [&](std::string_view path, double value) {
    const auto p = std::ranges::find(free, path, &FreeParameter::path);
    if (p != free.end() && std::isfinite(value)) set_parameter(out, path, std::clamp(value, p->low, p->high));
  };
  const auto mean = [&](auto value) {
    double sum = 0;
    for (const auto& l : loops) sum += value(l) / static_cast<double>(loops.size());
    return sum;
  };
  set("polycrystal.bias_field", mean([](const Loop& l) { return l.bias; }));
  constexpr double quartiles = 1.35;  // between them, in standard deviations of a normal distribution
  set("polycrystal.interaction_field_std", mean([](const Loop& l) { return l.width; }) / quartiles);
  set("material.remanent_polarization", mean([](const Loop& l) { return l.polarization; }));
  set("material.permittivity_180", mean([](const Loop& l) { return l.permittivity; }));
  set("material.permittivity_90", mean([](const Loop& l) { return l.permittivity; }));
  for (const auto& l : loops) {
    if (l.piezoelectric) set("material.piezoelectric_180", *l.piezoelectric);
    if (l.strain_90) set("material.remanent_strain_90", *l.strain_90);
  }
  const double thermal = boltzmann * start.material.temperature;
  const auto barrier = barrier_of(loops, start.material.relaxation_time,
                                  start.material.activation_volume * start.material.barrier / thermal);
  set("material.barrier", 0.25 * barrier.field * out.material.remanent_polarization);
  set("material.activation_volume", barrier.over_thermal * thermal / out.material.barrier);
  return out;
}

}  // namespace ferrobench::model
