#include "daq/replay/replay_source.h"

#include <algorithm>
#include <cmath>

#include "recordings/analysis/window.h"
#include "recordings/format/parts.h"

namespace ferrobench::daq {

using recordings::Channel;
using recordings::Recording;

namespace {

constexpr double widest_field = 1e9;  // V/m, as Limits allow
constexpr double longest = 1e9;       // s, as Limits allow
constexpr double safe_stop_share = 1.01;

[[noreturn]] void refuse(const std::string& place, const std::string& message, const std::string& hint) {
  throw Error(ErrorCode::bad_recording, "the recording cannot be played",
              Problem{.path = place, .message = message, .hint = hint});
}

// Straight lines across what is not known; the ends stay at the nearest known level. NaN if nothing is known.
std::vector<double> bridged(std::vector<double> values) {
  const auto known = [](double v) { return !std::isnan(v); };
  auto last = std::find_if(values.begin(), values.end(), known);
  if (last != values.end()) std::fill(values.begin(), last, *last);
  while (last != values.end()) {
    const auto next = std::find_if(last + 1, values.end(), known);
    const double from = *last, to = next == values.end() ? *last : *next;
    const auto steps = static_cast<double>(next - last);
    for (auto at = last + 1; at < next; ++at)
      *at = from + (to - from) * static_cast<double>(at - last) / steps;
    last = next;
  }
  return values;
}

double most_count_value(const recordings::RawColumn& c) {
  return std::abs(c.gain) * 32768 + std::abs(c.offset);
}

}  // namespace

ReplaySource::ReplaySource(Recording recording, const ReplayConfig& config)
    : recording_(recordings::window(std::move(recording), config.from, config.to)) {
  if (recording_.size() < 2)
    refuse("/entry/data/time", "has fewer than two samples", "there is nothing to play");
  if (config.played == Played::signals) recording_.raw.reset();
  calibrate(config);
  find_command();
  find_grid();
  find_stretches();
}

void ReplaySource::calibrate(const ReplayConfig& config) {
  const auto changes = recalibrations(config);
  if (recording_.raw) columns_ = recording_.raw->columns;
  for (auto& column : columns_) {
    const auto& change = changes[static_cast<std::size_t>(column.channel)];
    if (change.changes()) {
      column.gain *= change.gain;
      column.offset = change.offset + change.gain * column.offset;
    }
    if (column.gain == 0 || !std::isfinite(most_count_value(column)))
      refuse("/entry/instrument/raw/ai@gain", "is not a scaling that counts can have",
             "play the SI values instead: played = signals");
  }
  if (recording_.raw) recording_.raw->columns = columns_;
  for (const auto channel : recordings::all_channels) {
    const auto c = static_cast<std::size_t>(channel);
    const auto& change = changes[c];
    if (channel != Channel::command && recording_.has(channel) &&
        std::ranges::find(columns_, channel, &recordings::RawColumn::channel) == columns_.end())
      signals_.push_back(channel);
    if (!recording_.has(channel) || !change.changes()) continue;
    for (auto& value : *recording_.channels[c]) value = change.offset + change.gain * value;
    if (recording_.noise[c]) *recording_.noise[c] *= std::abs(change.gain);
  }
}

void ReplaySource::find_command() {
  const auto played = recording_.has(Channel::command) ? Channel::command : Channel::field;
  if (!recording_.has(played))
    refuse("/entry/data", "has neither command nor field", "there is nothing to play");
  auto levels = bridged(recording_.at(played));
  if (std::isnan(levels.front()))
    refuse(recordings::channel_place(played), "has no known value", "there is nothing to play");
  for (const double level : levels)
    if (!(std::abs(level) <= widest_field))
      refuse(recordings::channel_place(played), "is past any field that can be played",
             "at most 1e9 V/m either way");
  command_ = std::make_shared<const std::vector<double>>(std::move(levels));
}

void ReplaySource::find_grid() {
  const auto& t = recording_.time;
  const double mean = static_cast<double>(t.size() - 1) / (t.back() - t.front());
  if (!(std::isfinite(mean) && mean > 0)) refuse("/entry/data/time", "cannot be a time", "");
  std::vector<double> rates{mean, std::round(mean)};
  const auto& device = recording_.header.device;
  if (device.is_object() && device.contains("sample_rate") && device["sample_rate"].is_number())
    rates.insert(rates.begin(), device["sample_rate"].get<double>());
  for (const double rate : rates) {
    if (!(rate > 0)) continue;
    rate_ = rate;
    on_grid_ = true;
    for (std::size_t i = 0; i < t.size() && on_grid_; ++i) on_grid_ = t[i] == static_cast<double>(i) / rate;
    if (on_grid_) return;
  }
  rate_ = mean;
}

void ReplaySource::find_stretches() {
  std::vector<const std::vector<double>*> measured;
  for (const auto channel : recordings::all_channels)
    if (channel != Channel::command && recording_.has(channel)) measured.push_back(&recording_.at(channel));
  const auto* command = recording_.has(Channel::command) ? &recording_.at(Channel::command) : nullptr;
  for (std::size_t i = 0; i < size(); ++i) {
    const bool commanded = command == nullptr || !std::isnan((*command)[i]);
    const bool answered = measured.empty() ||
                          std::ranges::any_of(measured, [i](const auto* v) { return !std::isnan((*v)[i]); });
    const auto known = commanded ? (answered ? Known::all : Known::only_the_command)
                                 : (answered ? Known::not_the_command : Known::nothing);
    if (stretches_.empty() || stretches_.back().known != known) stretches_.push_back({i, known});
  }
}

double ReplaySource::time(std::uint64_t row) const {
  if (row < size()) return recording_.time[row];
  return recording_.time.back() + static_cast<double>(row - size() + 1) / rate_;
}

protocols::SampledWaveform ReplaySource::program() const {
  const double duration = static_cast<double>(size() - 1) / rate_;
  protocols::Piece piece{.kind = protocols::PieceKind::samples,
                         .duration = duration,
                         .from = command_->front(),
                         .to = command_->back()};
  piece.levels = command_;
  return {protocols::Waveform(
              {piece},
              {{.kind = "ramp", .label = "replay", .start = 0, .end = duration, .level = command_->back()}}),
          rate_};
}

Limits ReplaySource::limits(Limits bench) const {
  Limits l = bench;
  double step = 0;
  for (std::size_t i = 1; i < size(); ++i)
    step = std::max(step, std::abs((*command_)[i] - (*command_)[i - 1]));
  const auto [low, high] = std::ranges::minmax(*command_);
  l.field_min = std::min(l.field_min, low);
  l.field_max = std::max(l.field_max, high);
  l.slew = std::min(std::max(l.slew, safe_stop_share * step * rate_), 1e12);
  l.reverse_field_time =
      std::min(std::max(l.reverse_field_time, static_cast<double>(size() + 1) / rate_), longest);
  // No count can pass the full scale of its converter.
  for (const auto& column : columns_) {
    const double full = most_count_value(column);
    if (column.channel == Channel::field) {
      l.field_min = std::min(l.field_min, std::max(-full, -widest_field));
      l.field_max = std::max(l.field_max, std::min(full, widest_field));
    } else if (column.channel == Channel::displacement) {
      l.displacement_min = std::min(l.displacement_min, -full);
      l.displacement_max = std::max(l.displacement_max, full);
    } else if (column.channel == Channel::force) {
      l.force_min = std::min(l.force_min, -full);
      l.force_max = std::max(l.force_max, full);
    }
  }
  l.stop_slew = std::max(l.stop_slew, std::max(-l.field_min, l.field_max) / l.stop_time);
  l.slew = std::max(l.slew, l.stop_slew);
  return l;
}

recordings::Header ReplaySource::header() const {
  return recording_.header;
}

ReplaySource::Closing ReplaySource::closing(End end, const std::string& reason,
                                            std::vector<recordings::SegmentRow> played,
                                            std::uint64_t rows_read) const {
  const auto& r = recording_;
  // A recording that was still being written is one that has been recovered, once it is copied.
  if (end == End::complete)
    return {.status = recordings::is_open(r.status) ? "recovered" : r.status,
            .reason = r.reason,
            .segments = r.segments};
  Closing out{.status = "aborted", .reason = reason, .segments = {}};
  const auto left = played.size() > 1 ? played[1].start_sample : static_cast<std::int64_t>(rows_read);
  for (auto row : r.segments) {
    row.end_sample = std::min(row.end_sample, left);
    if (row.end_sample > row.start_sample) out.segments.push_back(std::move(row));
  }
  if (played.size() > 1) out.segments.push_back(std::move(played[1]));
  return out;
}

}  // namespace ferrobench::daq
