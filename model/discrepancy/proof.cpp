#include "model/discrepancy/proof.h"

#include <algorithm>
#include <cmath>

#include "model/discrepancy/naming.h"

namespace ferrobench::model::discrepancy {
namespace {

constexpr std::size_t fewest_rows = 15;  // of a stretch that says anything
constexpr int rounds = 3;                // in which a drive settles

struct Squares {
  double sum = 0;
  std::size_t count = 0;
  void add(double e) {
    if (std::isnan(e)) return;
    sum += e * e;
    ++count;
  }
  double mean() const { return sum / static_cast<double>(count); }
};

}  // namespace

Prediction predict(const RecordingMisfit& fine, const RecordingMisfit& usual, const Fit& fit) {
  const auto& chosen = fine.chosen();
  Prediction out{.simulated = Signals(chosen.size()), .residuals = Signals(chosen.size())};
  in_parallel(chosen.size(), fine.threads(), [&](std::size_t i) {
    out.simulated[i] = fine.simulated(fit.hypothesis, fit.z, chosen[i]);
    const auto& r = fine.bench()[chosen[i]];
    Eigen::VectorXd normals = Eigen::VectorXd::Zero(r.knot_error.cols());
    for (int round = 0; round < rounds && !r.level_of.empty(); ++round) {
      normals = usual.settled_drive(fit.hypothesis, fit.z, i, normals, out.simulated[i]);
      const auto drive = r.with_knots_moved(r.knot_error * normals);
      out.simulated[i] = fine.simulated(fit.hypothesis, fit.z, chosen[i], &drive);
    }
    for (std::size_t c = 0; c < out.simulated[i].size(); ++c)
      out.residuals[i].push_back(fine.plain_residual(chosen[i], c, out.simulated[i][c]));
  });
  return out;
}

ChannelFigures rms_by_channel(const RecordingMisfit& misfit, const Signals& residuals) {
  std::map<recordings::Channel, Squares> squares;
  for (std::size_t i = 0; i < residuals.size(); ++i)
    for (std::size_t c = 0; c < residuals[i].size(); ++c)
      for (const double e : residuals[i][c])
        squares[misfit.bench()[misfit.chosen()[i]].channels[c].channel].add(e);
  ChannelFigures out;
  for (const auto& [channel, s] : squares)
    if (s.count > 0) out[channel] = std::sqrt(s.mean());
  return out;
}

std::set<std::size_t> unexplained(const RecordingMisfit& misfit, const Signals& residuals) {
  std::set<std::size_t> out;
  for (std::size_t i = 0; i < residuals.size(); ++i)
    for (const auto& channel : residuals[i]) {
      Squares squares;
      for (const double e : channel) squares.add(e);
      if (squares.count > 0 && squares.mean() > 1 + plain_excess) out.insert(misfit.chosen()[i]);
    }
  return out;
}

std::vector<Excess> excess_by_stretch(const RecordingMisfit& misfit, const Signals& residuals) {
  std::vector<Excess> out;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const auto& r = misfit.bench()[misfit.chosen()[i]];
    for (std::size_t c = 0; c < residuals[i].size(); ++c) {
      std::array<Squares, stretch_count> squares{};
      for (std::size_t row = 0; row < r.time.size(); ++row)
        squares.at(static_cast<std::size_t>(r.stretch[row])).add(residuals[i][c][row]);
      for (std::size_t s = 0; s < stretch_count; ++s)
        if (squares.at(s).count >= fewest_rows)
          out.push_back({r.name, r.channels[c].channel, std::string(stretch_name(static_cast<Stretch>(s))),
                         std::sqrt(squares.at(s).mean())});
    }
  }
  std::ranges::stable_sort(out, std::greater<>(), &Excess::excess);
  return out;
}

std::vector<Trace> traces(const RecordingMisfit& misfit, const Prediction& before, const Prediction& after,
                          std::size_t count, bool held_out) {
  struct Place {
    std::size_t position = 0, channel = 0;
    double gained = 0;
  };
  std::vector<Place> places;
  for (std::size_t i = 0; i < before.residuals.size(); ++i)
    for (std::size_t c = 0; c < before.residuals[i].size(); ++c) {
      const auto &a = before.residuals[i][c], &b = after.residuals[i][c];
      double gained = 0;
      for (std::size_t row = 0; row < a.size(); ++row)
        if (!std::isnan(a[row])) gained += a[row] * a[row] - b[row] * b[row];
      places.push_back({i, c, gained});
    }
  std::ranges::stable_sort(places, std::greater<>(), &Place::gained);
  std::vector<Trace> out;
  for (const auto& p : places) {
    if (out.size() == count) break;
    const auto& r = misfit.bench()[misfit.chosen()[p.position]];
    const auto& a = before.residuals[p.position][p.channel];
    // The window of a sixth of the recording in which the base model misses most.
    const std::size_t n = r.time.size(), width = std::max<std::size_t>(std::min<std::size_t>(n, 60), n / 6);
    double sum = 0, most = -1;
    std::size_t begin = 0;
    for (std::size_t row = 0; row < n; ++row) {
      sum += std::isnan(a[row]) ? 0 : a[row] * a[row];
      if (row >= width) sum -= std::isnan(a[row - width]) ? 0 : a[row - width] * a[row - width];
      if (row + 1 >= width && sum > most) {
        most = sum;
        begin = row + 1 - width;
      }
    }
    Trace t{.recording = r.name,
            .channel = r.channels[p.channel].channel,
            .segment = std::string(stretch_name(r.stretch[begin + width / 2])),
            .held_out = held_out,
            .time = {},
            .measured = {},
            .before = {},
            .after = {}};
    for (std::size_t row = begin; row < begin + width; ++row) {
      t.time.push_back(r.time[row]);
      t.measured.push_back(r.channels[p.channel].value[row]);
      t.before.push_back(before.simulated[p.position][p.channel][row]);
      t.after.push_back(after.simulated[p.position][p.channel][row]);
    }
    out.push_back(std::move(t));
  }
  return out;
}

}  // namespace ferrobench::model::discrepancy
