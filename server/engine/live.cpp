#include "server/engine/live.h"

#include <algorithm>
#include <cmath>

#include "recordings/analysis/thinning.h"
#include "recordings/format/iso_time.h"
#include "server/rpc/schemas.h"

namespace ferrobench::server {

using nlohmann::json;

namespace {

// A block of a run in real time is some 12 ms. One of a fast run is seconds or hours, of which a picture
// shows more.
std::size_t bins_of(const recordings::Rows& rows) {
  constexpr double at_least = 20, per_second = 1000;
  if (rows.time.empty()) return max_bins;
  const double wanted = per_second * (rows.time.back() - rows.time.front());
  return static_cast<std::size_t>(std::clamp(wanted, at_least, static_cast<double>(max_bins)));
}

// JSON has no NaN: a stretch without a value is null.
json value(double v) {
  return std::isfinite(v) ? json(v) : json(nullptr);
}

json pick(std::string_view part, const json& a, const json& b) {
  if (part == "first" || b.is_null()) return a;
  if (a.is_null()) return b;
  return (a.get<double>() < b.get<double>()) == (part == "max") ? b : a;
}

json joined(std::string_view part, const json& values, const std::vector<std::size_t>& begins) {
  json out = json::array();
  for (std::size_t k = 0; k < begins.size(); ++k) {
    const auto end = k + 1 < begins.size() ? begins[k + 1] : values.size();
    out.push_back(values[begins[k]]);
    for (auto i = begins[k] + 1; i < end; ++i) out.back() = pick(part, out.back(), values[i]);
  }
  return out;
}

void append(json& to, const json& from) {
  for (const auto& item : from) to.push_back(item);
}

}  // namespace

Topic samples_topic() {
  return {.name = "samples",
          .doc = "smallest and largest value of each channel over stretches of rows, while a run goes on",
          .schema = schema::object(
              {{"run", schema::text()}, {"measured", schema::text()}, {"columns", schema::stretches()}}),
          .merge = merge_samples};
}

json decimate(const recordings::Rows& rows, std::span<const std::size_t> begins) {
  json columns{{"time", json::array()}};
  for (const auto begin : begins) columns["time"].push_back(rows.time[begin]);
  for (const auto channel : recordings::all_channels) {
    const auto values = rows.channels.at(static_cast<std::size_t>(channel));
    if (values.empty()) continue;
    json first = json::array(), min = json::array(), max = json::array();
    for (std::size_t k = 0; k < begins.size(); ++k) {
      const auto end = k + 1 < begins.size() ? begins[k + 1] : values.size();
      double low = NAN, high = NAN;
      for (const double v : values.subspan(begins[k], end - begins[k])) {
        low = std::fmin(low, v);
        high = std::fmax(high, v);
      }
      first.push_back(value(values[begins[k]]));
      min.push_back(value(low));
      max.push_back(value(high));
    }
    columns[std::string(recordings::channel_name(channel))] = {
        {"first", std::move(first)}, {"min", std::move(min)}, {"max", std::move(max)}};
  }
  return columns;
}

void merge_samples(json& held, const json& next) {
  auto& columns = held["columns"];
  if (held["run"] != next["run"] || columns.size() != next["columns"].size()) {
    held = next;
    return;
  }
  held["measured"] = next["measured"];
  for (const auto& [name, column] : next["columns"].items()) {
    if (column.is_array()) {
      append(columns[name], column);
    } else {
      for (const auto& [part, values] : column.items()) append(columns[name][part], values);
    }
  }
  if (columns["time"].size() <= max_bins) return;
  const auto begins = recordings::stretches(columns["time"].get<std::vector<double>>(), max_bins / 2);
  for (auto& column : columns) {
    if (column.is_array()) {
      column = joined("first", column, begins);
    } else {
      for (const auto& [part, values] : column.items()) column[part] = joined(part, values, begins);
    }
  }
}

void LiveStream::add(const recordings::Rows& rows) {
  if (!hub_.wanted("samples")) {
    held_ = nullptr;
    return;
  }
  json next{{"run", run_},
            {"measured", recordings::iso_now()},
            {"columns", decimate(rows, recordings::stretches(rows.time, bins_of(rows)))}};
  if (held_.is_null()) {
    held_ = std::move(next);
  } else {
    merge_samples(held_, next);
  }
  if (pace_.passes(Pace::Clock::now())) send();
}

void LiveStream::finish() {
  if (!held_.is_null()) send();
  hub_.flush("samples");
}

void LiveStream::send() {
  hub_.publish("samples", held_);
  held_ = nullptr;
}

}  // namespace ferrobench::server
