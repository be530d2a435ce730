#include "recordings/analysis/mean_of_passes.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/number_text.h"
#include "protocols/protocol.h"
#include "recordings/analysis/clipping.h"
#include "recordings/analysis/program.h"
#include "recordings/format/iso_time.h"

namespace ferrobench::recordings {
namespace {

using protocols::Waveform;

// A pass as it was played: the samples of its corners, one more than it has segments.
struct Pass {
  std::size_t number = 0;
  std::vector<std::size_t> corners;
};

// The pass of the pieces [first, last) of the program; what is wrong with it goes to `why`.
std::optional<Pass> whole_pass(const Recording& r, const Waveform& program, std::size_t number,
                               std::size_t first, std::size_t last, std::string& why) {
  Pass pass{.number = number, .corners = {}};
  for (auto k = first; k < last; ++k) {
    const auto& piece = program.pieces()[k];
    // Rows that are not the program's own, of a part of a recording or a stop, have other names.
    if (k >= r.segments.size() || r.segments[k].label != program.segments()[k].label) {
      why = "was not played to its end";
      return std::nullopt;
    }
    const auto from = static_cast<std::size_t>(std::max<std::int64_t>(r.segments[k].start_sample, 0));
    const auto to = std::min(static_cast<std::size_t>(r.segments[k].end_sample), r.size() - 1);
    if (from >= to) {
      why = "has a segment without samples, \"" + r.segments[k].label + "\"";
      return std::nullopt;
    }
    const double longer = r.time[to] - r.time[from] - piece.duration;
    // Corners lie on the samples nearest to them.
    const double step = std::max(r.time[from + 1] - r.time[from], 1e-9 * piece.duration);
    if (std::abs(longer) > 1.5 * step) {
      why = longer < 0 ? "was not played to its end"
                       : "is " + number_text(longer) + " s longer in \"" + r.segments[k].label + "\"";
      return std::nullopt;
    }
    pass.corners.push_back(from);
    if (k + 1 == last) pass.corners.push_back(to);
  }
  return pass;
}

// A channel of a pass, on the samples of the pass that the others are put on.
std::vector<double> on_samples_of(const Pass& lead, const Pass& pass, const std::vector<double>& time,
                                  const std::vector<double>& values) {
  std::vector<double> out;
  out.reserve(lead.corners.back() - lead.corners.front() + 1);
  for (std::size_t s = 0; s + 1 < lead.corners.size(); ++s) {
    const auto first = lead.corners[s], last = lead.corners[s + 1];
    const double start = time[pass.corners[s]];
    const double stretch = (time[pass.corners[s + 1]] - start) / (time[last] - time[first]);
    auto at = pass.corners[s];
    for (auto i = first; i < last; ++i) {
      const double t = start + stretch * (time[i] - time[first]);
      while (at + 1 < pass.corners[s + 1] && time[at + 1] <= t) ++at;
      const double step = time[at + 1] - time[at];
      const double share = std::clamp((t - time[at]) / step, 0.0, 1.0);
      // Where samples coincide but for rounding, their values do.
      constexpr double rounding = 1e-6;
      out.push_back(share < rounding       ? values[at]
                    : share > 1 - rounding ? values[at + 1]
                                           : std::lerp(values[at], values[at + 1], share));
    }
  }
  out.push_back(values[pass.corners.back()]);
  return out;
}

// The mean of the channel; its noise, where there is a scatter to see it from.
std::vector<double> mean_of(const std::vector<std::vector<double>>& passes, std::optional<double>& noise) {
  const auto rows = passes.front().size();
  const auto count = static_cast<double>(passes.size());
  std::vector<double> mean(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    for (const auto& pass : passes) mean[i] += pass[i];
    mean[i] /= count;
  }
  double squares = 0, known = 0;
  for (const auto& pass : passes) {
    double sum = 0, own = 0, distance = 0;
    for (std::size_t i = 0; i < rows; ++i) {
      const double d = pass[i] - mean[i];
      if (!std::isfinite(d)) continue;
      distance += d;
      sum += d * d;
      ++own;
    }
    if (own == 0) return mean;
    squares += std::max(0.0, sum - distance * distance / own);
    known = own;
  }
  if (known > 1) noise = std::sqrt(squares / ((known - 1) * (count - 1) * count));
  return mean;
}

nlohmann::json protocol_of_a_pass(const nlohmann::json& protocol, const Waveform& program, double level) {
  auto out = protocol;
  auto repeat = protocol.at(nlohmann::json::json_pointer(program.averaged()->path));
  repeat.erase("average");
  repeat["count"] = 1;
  out["segments"] = nlohmann::json::array({std::move(repeat)});
  out["start"] = program.unit().level(level);
  out.erase("past");
  return out;
}

// What was visited before a piece; a bent one as chords, an eighth of a turn each.
// Unknown where that is too much to be gone through again.
protocols::Past before_piece(const protocols::Past& past, const Waveform& program, std::size_t end) {
  std::vector<protocols::VisitedLevel> out;
  for (std::size_t k = 0; k < end; ++k) {
    const auto& piece = program.pieces()[k];
    const double turns = piece.kind == protocols::PieceKind::sine ? piece.frequency * piece.duration : 0;
    const double wanted = std::max(1.0, std::ceil(8 * turns));
    if (static_cast<double>(out.size()) + wanted > protocols::most_visited_levels) return {};
    const auto chords = static_cast<int>(wanted);
    const double each = piece.duration / chords;
    for (int c = 1; c <= chords; ++c) out.push_back({piece.value(piece.start + each * c), each});
  }
  return and_then(past, out);
}

}  // namespace

std::string MeanOfPasses::in_words() const {
  const bool unbroken = passes.back() - passes.front() + 1 == passes.size();
  if (unbroken)
    return "passes " + std::to_string(passes.front()) + (passes.size() == 2 ? " and " : " to ") +
           std::to_string(passes.back());
  std::string out = "passes ";
  for (std::size_t i = 0; i < passes.size(); ++i)
    out += (i == 0 ? "" : i + 1 == passes.size() ? " and " : ", ") + std::to_string(passes[i]);
  return out;
}

std::optional<MeanOfPasses> mean_of_passes(const Recording& r) {
  const auto program = r.size() < 2 ? std::nullopt : program_of(r.header.protocol);
  if (!program || !program->averaged()) return std::nullopt;
  const auto& begin = program->averaged()->begin;
  MeanOfPasses out;
  std::vector<Pass> passes;
  for (std::size_t k = 1; k + 1 < begin.size(); ++k) {
    std::string why;
    if (auto pass = whole_pass(r, *program, k + 1, begin[k], begin[k + 1], why)) {
      out.passes.push_back(pass->number);
      passes.push_back(std::move(*pass));
    } else {
      out.left_out.push_back("Pass " + std::to_string(k + 1) + " " + why + ".");
    }
  }
  const bool described = r.header.device.is_null() || r.header.device.is_object();
  if (passes.size() < 2 || passes.front().corners.size() < 2 || !described) return std::nullopt;

  const auto& lead = passes.front();
  const auto first = lead.corners.front(), last = lead.corners.back();
  auto& mean = out.recording;
  mean.header = r.header;
  mean.header.title += (r.header.title.empty() ? "" : ", ") + ("mean of " + out.in_words());
  mean.header.start_time =
      iso_after(r.header.start_time, r.time[first] - r.time.front()).value_or(r.header.start_time);
  mean.header.run_seed.reset();
  const auto& lead_piece = program->pieces()[begin[lead.number - 1]];
  mean.header.protocol = protocol_of_a_pass(r.header.protocol, *program, lead_piece.from);
  mean.header.past = before_piece(r.header.past, *program, begin[lead.number - 1]);
  mean.header.device["mean_of"] = {
      {"source_identifier", r.header.entry_identifier}, {"passes", out.passes}, {"left_out", out.left_out}};
  for (auto i = first; i <= last; ++i) mean.time.push_back(r.time[i] - r.time[first]);
  for (const auto channel : all_channels) {
    if (!r.has(channel)) continue;
    auto& values = mean.set(channel);
    if (channel == Channel::command) {
      const auto from = r.at(channel).begin();
      values.assign(from + static_cast<std::ptrdiff_t>(first), from + static_cast<std::ptrdiff_t>(last) + 1);
      continue;
    }
    std::vector<std::vector<double>> each;
    each.reserve(passes.size());
    for (const auto& pass : passes) each.push_back(on_samples_of(lead, pass, r.time, r.at(channel)));
    values = mean_of(each, mean.noise.at(static_cast<std::size_t>(channel)));
    if (channel == Channel::charge && r.header.charge_reference == ChargeReference::first_sample)
      for (const double zero = values.front(); auto& value : values) value -= zero;
  }
  const auto own = protocols::Protocol::from_json(mean.header.protocol).expand();
  for (std::size_t s = 0; s + 1 < lead.corners.size(); ++s) {
    auto row = r.segments[begin[lead.number - 1] + s];
    if (s < own.segments().size()) row.label = own.segments()[s].label;
    row.start_sample = static_cast<std::int64_t>(lead.corners[s] - first);
    row.end_sample = static_cast<std::int64_t>(lead.corners[s + 1] - first);
    if (s + 2 == lead.corners.size()) ++row.end_sample;  // half-open
    mean.segments.push_back(std::move(row));
  }
  mean.end_time = iso_after(mean.header.start_time, mean.time.back()).value_or(mean.header.start_time);
  mean.events.push_back({0, "mean", "of " + out.in_words()});
  for (const auto& why : out.left_out) mean.events.push_back({0, "mean", why});
  const Clipping clipping(r);
  for (std::size_t s = 0; s + 1 < lead.corners.size(); ++s)
    for (const auto& pass : passes)
      for (const auto channel : all_channels)
        if (clipping.any(std::span(&channel, 1), pass.corners[s], pass.corners[s + 1]))
          mean.events.push_back({r.time[lead.corners[s]] - r.time[first], "clipped",
                                 std::string(channel_name(channel)) + " was past its range in pass " +
                                     std::to_string(pass.number)});
  return out;
}

}  // namespace ferrobench::recordings
