#include "server/methods/recording_curves.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "recordings/analysis/creep.h"
#include "recordings/analysis/loops.h"
#include "recordings/analysis/parts.h"
#include "recordings/analysis/segments.h"
#include "recordings/analysis/thinning.h"
#include "server/rpc/schemas.h"

namespace ferrobench::server {
namespace {

using nlohmann::json;
using recordings::Recording;

constexpr std::string_view time_axis = "time", hold_axis = "time_in_hold";
constexpr std::size_t most_cycles = 40;

std::vector<std::string> axes_there(const Recording& r) {
  std::vector<std::string> out{std::string(time_axis), std::string(hold_axis)};
  for (const auto channel : recordings::all_channels)
    if (r.has(channel)) out.emplace_back(channel_name(channel));
  return out;
}

[[noreturn]] void refuse(const Recording& r, const std::string& axis, std::size_t number) {
  throw Error(ErrorCode::invalid_params, "the recording has no such axis",
              Problem{.path = "/axes/" + std::to_string(number),
                      .message = "is no column of this recording",
                      .given = axis,
                      .allowed = axes_there(r)});
}

std::optional<recordings::Channel> channel_of(const Recording& r, const std::string& axis) {
  for (const auto channel : recordings::all_channels)
    if (axis == channel_name(channel) && r.has(channel)) return channel;
  return std::nullopt;
}
const std::vector<double>& column(const Recording& r, const std::string& axis, std::size_t number) {
  if (axis == time_axis) return r.time;
  if (const auto channel = channel_of(r, axis)) return r.at(*channel);
  refuse(r, axis, number);
}

json value(double v) {
  return std::isfinite(v) ? json(v) : json(nullptr);
}
json values(const std::vector<double>& column, std::size_t first, const std::vector<std::size_t>& kept) {
  json out = json::array();
  for (const auto i : kept) out.push_back(value(column[first + i]));
  return out;
}
json values(const std::vector<double>& column) {
  json out = json::array();
  for (const double v : column) out.push_back(value(v));
  return out;
}

// Hold by hold, the change since its start.
json creep_of(const Recording& r, const std::string& axis) {
  const auto channel = channel_of(r, axis);
  if (!channel) refuse(r, axis, 1);
  json curves = json::array();
  for (const auto& curve : creep_curves(r, signal(r, *channel), recordings::bias_sines(r)))
    curves.push_back({{"label", curve.hold.label},
                      {"cycle", nullptr},
                      {"level", curve.hold.level},
                      {"x", values(curve.time)},
                      {"y", values(curve.change)}});
  return {{"rows", r.size()}, {"axes", {hold_axis, axis}}, {"curves", std::move(curves)}};
}

double range(std::span<const double> values) {
  const auto found = recordings::extremes(values);
  return found && found->span() > 0 ? found->span() : 1;
}

std::string name_of(recordings::ToldBy by) {
  return by == recordings::ToldBy::rate        ? "rate"
         : by == recordings::ToldBy::frequency ? "frequency"
                                               : "cycle";
}

}  // namespace

json curves_of(const Recording& r, const std::vector<std::string>& axes, std::size_t first, std::size_t rows,
               std::size_t pixels, std::size_t most) {
  if (axes.size() != 2)
    throw Error(ErrorCode::invalid_params, "a curve has two axes",
                Problem{.path = "/axes",
                        .message = "are not two",
                        .given = axes,
                        .allowed = axes_there(r),
                        .hint = "for example [\"field\", \"displacement\"]"});
  if (axes[0] == hold_axis) return creep_of(r, axes[1]);
  const auto &x = column(r, axes[0], 0), &y = column(r, axes[1], 1);
  const auto x_part = std::span(x).subspan(first, rows), y_part = std::span(y).subspan(first, rows);
  const auto width = static_cast<double>(pixels);
  const double x_pixel = range(x_part) / width, y_pixel = range(y_part) / width;
  const auto parts = parts_of(r, find_cycles(r, turning_points(r)), most_cycles);
  json curves = json::array();
  double worst = 0.5;
  for (const auto& part : parts.parts) {
    const auto begin = std::max(part.first, first), end = std::min(part.last + 1, first + rows);
    if (begin >= end) continue;
    const auto thinned = recordings::thin_to(std::span(x).subspan(begin, end - begin),
                                             std::span(y).subspan(begin, end - begin), x_pixel, y_pixel, 0.5,
                                             most / parts.parts.size() + 2);
    worst = std::max(worst, thinned.error);
    json curve{{"label", parts.label(part)},
               {"cycle", part.cycle ? json(*part.cycle + 1) : json(nullptr)},
               {"x", values(x, begin, thinned.kept)},
               {"y", values(y, begin, thinned.kept)}};
    if (part.cycle && part.rate > 0) curve["rate"] = part.rate;
    if (part.cycle) curve["frequency_Hz"] = part.frequency;
    curves.push_back(std::move(curve));
  }
  return {{"rows", rows},
          {"axes", axes},
          {"chord_error", worst / width},
          {"told_by", name_of(parts.by)},
          {"cycles", parts.cycles},
          {"curves", std::move(curves)}};
}

json segment_rows(const Recording& r) {
  constexpr std::size_t most = 1000;
  json out = json::array();
  if (r.size() == 0 || !(r.has(recordings::Channel::command) || r.has(recordings::Channel::field)))
    return out;
  const auto at = [&](std::int64_t sample) {
    return r.time[std::min(static_cast<std::size_t>(std::max<std::int64_t>(sample, 0)), r.size() - 1)];
  };
  for (const auto& row : segments_of(r)) {
    if (out.size() >= most) break;
    out.push_back({{"kind", row.kind},
                   {"label", row.label},
                   {"start_s", at(row.start_sample)},
                   {"end_s", at(row.end_sample)},
                   {"level", row.level},
                   {"rate", row.rate}});
  }
  return out;
}

json curves_schema() {
  using namespace schema;
  const auto points = list_of(or_null(number("", "in SI; null where nothing was measured")));
  auto out = stretches();
  const auto curves = list_of(object({{"label", text("of the cycle or the hold; \"\" outside of both")},
                                      {"cycle", or_null(whole("from 1"))},
                                      {"rate", number("V/m/s", "of the longest ramp")},
                                      {"level", number("V/m", "of a hold")},
                                      {"frequency_Hz", number("Hz", "one over the cycle's duration")},
                                      {"x", points},
                                      {"y", points}}));
  out["properties"]["row"] = list_of(whole(), "of the recording, with which each stretch begins");
  out["properties"]["axes"] = list_of(text());
  out["properties"]["chord_error"] =
      number("", "how far points that were left out lie beside the line, as a share of the axes' ranges");
  out["properties"]["told_by"] = text("what tells the cycles apart: cycle, rate or frequency");
  out["properties"]["cycles"] = whole("that the recording has; at most 40 are given");
  out["properties"]["curves"] = curves;
  out["properties"]["segments"] = list_of(object({{"kind", text("ramp or hold")},
                                                  {"label", text()},
                                                  {"start_s", number("s")},
                                                  {"end_s", number("s")},
                                                  {"level", number("V/m", "at the end")},
                                                  {"rate", number("V/m/s")}}),
                                          "the first 1000, where no axes were asked for");
  return out;
}

}  // namespace ferrobench::server
