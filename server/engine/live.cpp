#include "server/engine/live.h"

#include <cmath>

#include "recordings/format/iso_time.h"
#include "server/rpc/schemas.h"

namespace ferrobench::server {

using nlohmann::json;

namespace {

constexpr std::size_t bins_per_block = 20;

// JSON has no NaN: a stretch without a value is null.
json value(double v) {
  return std::isfinite(v) ? json(v) : json(nullptr);
}

json pick(std::string_view part, const json& a, const json& b) {
  if (part == "first" || b.is_null()) return a;
  if (a.is_null()) return b;
  return (a.get<double>() < b.get<double>()) == (part == "max") ? b : a;
}

json joined(std::string_view part, const json& values) {
  json out = json::array();
  for (std::size_t i = 0; i < values.size(); i += 2)
    out.push_back(i + 1 < values.size() ? pick(part, values[i], values[i + 1]) : values[i]);
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

json decimate(const recordings::Rows& rows, std::size_t bins) {
  const std::size_t count = rows.time.size();
  const std::size_t width = (count + bins - 1) / std::max<std::size_t>(bins, 1);
  json columns{{"time", json::array()}};
  for (std::size_t begin = 0; begin < count; begin += width) columns["time"].push_back(rows.time[begin]);
  for (const auto channel : recordings::all_channels) {
    const auto values = rows.channels.at(static_cast<std::size_t>(channel));
    if (values.empty()) continue;
    json first = json::array(), min = json::array(), max = json::array();
    for (std::size_t begin = 0; begin < count; begin += width) {
      double low = NAN, high = NAN;
      for (const double v : values.subspan(begin, std::min(width, count - begin))) {
        low = std::fmin(low, v);
        high = std::fmax(high, v);
      }
      first.push_back(value(values[begin]));
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
  while (columns["time"].size() > max_bins)
    for (auto& column : columns) {
      if (column.is_array()) {
        column = joined("first", column);
      } else {
        for (const auto& [part, values] : column.items()) column[part] = joined(part, values);
      }
    }
}

void LiveStream::add(const recordings::Rows& rows) {
  if (!hub_.wanted("samples")) {
    held_ = nullptr;
    return;
  }
  json next{{"run", run_}, {"measured", recordings::iso_now()}, {"columns", decimate(rows, bins_per_block)}};
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
