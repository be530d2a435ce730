// Exact slopes of whitened residuals on recordings: r = W (y - g y_sim(p)), so that
//
//   dr/dz = -W (g dy_sim/dp dp/dz + dg/dz y_sim)
//
// with dy_sim/dp from forward sensitivities (model/sensitivities.h).
#include <cmath>

#include "model/inference/common/parallel.h"
#include "model/inference/residuals/whitened_recordings.h"

namespace ferrobench::model::inference {

namespace {

// Where the derivative by a parameter of the hypothesis comes from, for one recording.
struct Source {
  enum class Kind { none, number, drive, gain } kind = Kind::none;
  std::size_t index = 0;  // of the number, of the drive's direction or of the channel
  double by = 0;          // d that / dz
};

struct Sources {
  std::vector<Source> of;            // by parameter
  std::vector<std::string> numbers;  // of the model, by their path
  std::size_t directions = 0;        // of the drive
  std::vector<double> field;         // d knot_field / dz, knots x directions
};

// What moves a simulation of `recording` (as it stands in the bench) at z, from parameter `first` on.
// `drive`: the knots as the setting has them.
Sources sources_of(const Hypothesis& hypothesis, const Eigen::VectorXd& z, Eigen::Index first,
                   const Setting& setting, const BenchRecording& recording, const BenchRecording& drive) {
  Sources out;
  std::vector<std::vector<double>> fields;
  const auto number = [&](std::string path, double by) {
    out.numbers.push_back(std::move(path));
    return Source{Source::Kind::number, out.numbers.size() - 1, by};
  };
  const auto moves_drive = [&](std::vector<double> field) {
    fields.push_back(std::move(field));
    return Source{Source::Kind::drive, fields.size() - 1, 1};
  };
  for (auto i = first; i < z.size(); ++i) {
    const auto& c = hypothesis.parameters[static_cast<std::size_t>(i)];
    const double slope = c.slope(z[i]);
    auto& source = out.of.emplace_back();
    const auto& load = recording.header.load;
    if (c.of_model()) {
      source = number(c.path, slope);
    } else if (c.path == "factor.spring_stiffness") {
      if (load.spring_stiffness > 0) source = number("load.spring_stiffness", slope * load.spring_stiffness);
    } else if (c.path == "factor.prestress") {
      if (load.prestress > 0) source = number("load.prestress", slope * load.prestress);
    } else if (c.path == "offset.field") {
      if (!recording.has_command)
        source = moves_drive(std::vector<double>(drive.knot_field.size(), -slope / setting.gain[0]));
    } else if (c.path == "gain.field" && !recording.has_command) {
      auto field = drive.knot_field;
      for (double& e : field) e *= -slope / setting.gain[0];
      source = moves_drive(std::move(field));
    } else {
      for (std::size_t k = 0; k < compared_channels.size(); ++k)
        if (c.path.substr(5) == recordings::channel_name(compared_channels.at(k)))
          source = {Source::Kind::gain, k, slope};
    }
  }
  out.directions = fields.size();
  for (std::size_t k = 0; out.directions > 0 && k < drive.knot_field.size(); ++k)
    for (const auto& field : fields) out.field.push_back(field[k]);
  return out;
}

}  // namespace

std::optional<Eigen::MatrixXd> WhitenedRecordings::slopes(const Hypothesis& hypothesis,
                                                          const Eigen::VectorXd& z,
                                                          Eigen::Index first) const {
  const auto count = z.size() - first;
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(size(), count);
  const auto found = possible_setting(hypothesis, z);
  if (!found) return std::nullopt;
  const auto& setting = *found;
  std::atomic<bool> solved = true;
  const auto ordered = parts();
  in_parallel(ordered.size(), threads(), [&](std::size_t i) {
    const std::size_t position = ordered[i];
    const auto& recording = bench_[chosen_[position]];
    const auto drive = apply_setting(setting, recording);
    const auto sources = sources_of(hypothesis, z, first, setting, recording, drive);
    const auto simulated = channels_with_slopes(setting, chosen_[position], drive, sources.numbers,
                                                {sources.directions, {}, sources.field});
    if (!simulated) {
      solved = false;
      return;
    }
    const std::size_t width = sources.numbers.size() + sources.directions;
    const auto [from, to] = blocks_of_[position];
    for (std::size_t b = from; b < to; ++b) {
      const auto& block = blocks_[b];
      const auto channel = recording.channels[block.channel].channel;
      const double gain = gain_of(setting, channel);
      const auto& values = simulated->values[block.channel];
      const auto& slopes = simulated->slopes[block.channel];
      for (Eigen::Index p = 0; p < count; ++p) {
        const auto& source = sources.of[static_cast<std::size_t>(p)];
        auto column = out.col(p).segment(block.begin, block.count);
        const std::size_t at =
            source.index + (source.kind == Source::Kind::drive ? sources.numbers.size() : 0);
        if (source.kind == Source::Kind::none ||
            (source.kind == Source::Kind::gain && compared_channels.at(source.index) != channel))
          continue;
        for (std::size_t row = 0; row < block.rows.size(); ++row)
          column[static_cast<Eigen::Index>(row)] =
              -source.by * (source.kind == Source::Kind::gain ? values[block.rows[row]]
                                                              : gain * slopes[block.rows[row] * width + at]);
        if (!column.allFinite()) {
          solved = false;
          return;
        }
        finish(b, column);
      }
    }
    if (!drive_marginals_.empty())
      for (Eigen::Index p = 0; p < count; ++p) marginalize(drive_marginals_[position], out.col(p));
  });
  if (!solved) return std::nullopt;
  return out;
}

Eigen::MatrixXd WhitenedRecordings::drive_jacobian(const Setting& setting, std::size_t position,
                                                   const Eigen::VectorXd& normals) const {
  const auto& r = bench_[chosen_[position]];
  const auto [first, last] = blocks_of_[position];
  const Eigen::Index begin = blocks_[first].begin;
  const auto at = apply_setting(setting, r.with_knots_moved(r.knot_error * normals));
  // Levels first, then the times of the inner knots (dataset/drive.h).
  const auto count = static_cast<std::size_t>(r.knot_error.cols());
  const auto levels = static_cast<Eigen::Index>(r.level_of.back() + 1);
  std::vector<double> time, field;
  for (std::size_t k = 0; k < at.knot_time.size(); ++k) {
    const bool inner = k > 0 && k + 1 < at.knot_time.size();
    for (Eigen::Index j = 0; j < r.knot_error.cols(); ++j) {
      field.push_back(r.knot_error(static_cast<Eigen::Index>(r.level_of[k]), j) / setting.gain[0]);
      time.push_back(inner ? r.knot_error(levels + static_cast<Eigen::Index>(k) - 1, j) : 0);
    }
  }
  const auto simulated = channels_with_slopes(setting, chosen_[position], at, {}, {count, time, field});
  if (!simulated)
    throw Error(ErrorCode::numerical, "what an uncertain drive does to " + r.name + " cannot be simulated");
  Eigen::MatrixXd out(blocks_[last - 1].begin + blocks_[last - 1].count - begin, r.knot_error.cols());
  for (std::size_t b = first; b < last; ++b) {
    const auto& block = blocks_[b];
    const double gain = gain_of(setting, r.channels[block.channel].channel);
    for (Eigen::Index j = 0; j < out.cols(); ++j) {
      auto column = out.col(j).segment(block.begin - begin, block.count);
      for (std::size_t row = 0; row < block.rows.size(); ++row)
        column[static_cast<Eigen::Index>(row)] =
            gain * simulated->slopes[block.channel][block.rows[row] * count + static_cast<std::size_t>(j)];
      finish(b, column);
    }
  }
  return out;
}

std::optional<BenchSlopes> WhitenedRecordings::channels_with_slopes(const Setting& setting,
                                                                    std::size_t recording,
                                                                    const BenchRecording& at,
                                                                    std::span<const std::string> numbers,
                                                                    const DriveDirections& directions) const {
  try {
    return simulate_bench_with_slopes(setting.model, at, numbers, directions, bounded(recording));
  } catch (const Error& e) {
    if (e.code() == ErrorCode::cancelled) throw;
    return std::nullopt;
  }
}

}  // namespace ferrobench::model::inference
