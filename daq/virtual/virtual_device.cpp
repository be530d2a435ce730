#include "daq/virtual/virtual_device.h"

#include <algorithm>
#include <cmath>
#include <thread>

namespace ferrobench::daq {

using recordings::Channel;

namespace {

// A chunk bounds how long a stop can wait in real time, and the memory of a fast scan.
constexpr double chunk_time = 0.06;  // s, so that a stop is on its way within 0.1 s on a busy machine
constexpr double chunk_rows = 2048;  // 20 ms at 100 kHz: 30 pictures a second are drawn of them
constexpr std::chrono::seconds patience{1};

std::vector<Converter> converters(const model::Model& model, const VirtualConfig& config) {
  const auto sensors = sensors_of(config, model);
  std::vector<Converter> out;
  const auto add = [&](Channel channel, const ChannelConfig& c) {
    if (c.enabled)
      out.emplace_back(channel, sensors[static_cast<std::size_t>(channel)],
                       static_cast<std::uint64_t>(config.seed));
  };
  add(Channel::field, config.field);
  add(Channel::charge, config.charge);
  add(Channel::displacement, config.displacement);
  add(Channel::force, config.force);
  return out;
}

model::ChannelSpans spans(std::array<std::vector<double>, 5>& values, std::size_t at, std::size_t count) {
  const auto part = [&](Channel c) {
    return std::span(values[static_cast<std::size_t>(c)]).subspan(at, count);
  };
  model::ChannelSpans out;
  out.field = part(Channel::field);
  out.charge = part(Channel::charge);
  out.displacement = part(Channel::displacement);
  out.force = part(Channel::force);
  return out;
}

}  // namespace

VirtualDevice::VirtualDevice(const model::Model& model, const VirtualConfig& config)
    : model_(model),
      config_(config),
      converters_(converters(model, config)),
      simulator_(model, {.tolerance = config.tolerance,
                         .domains = static_cast<int>(config.domains),
                         .past = &config_.past}) {
  for (auto& v : values_) v.resize(1);
  simulator_.start(0);
  // The first piece may give the state at its own beginning; it is too short for anything to happen.
  const double now = simulator_.time();
  simulator_.play(1e-9, 0, std::span(&now, 1), spans(values_, 0, 1));
  for (std::size_t c = 0; c < last_.size(); ++c) last_[c] = values_[c][0];
}

std::unique_ptr<Device> VirtualDevice::open(const nlohmann::json& config) {
  const auto settings = virtual_config_from_json(config);
  return std::make_unique<VirtualDevice>(model_of(settings), settings);
}

void VirtualDevice::check(const nlohmann::json& config) {
  model_of(virtual_config_from_json(config));
}

nlohmann::json VirtualDevice::info() const {
  nlohmann::json channels = nlohmann::json::array();
  for (const auto& converter : converters_) {
    const auto& sensor = converter.sensor();
    const auto column = converter.column();
    channels.push_back({{"channel", recordings::channel_name(column.channel)},
                        {"unit", recordings::channel_unit(column.channel)},
                        {"range", sensor.range},
                        {"lsb", column.gain},
                        {"noise", sensor.noise},
                        {"gain", sensor.gain},
                        {"offset", sensor.offset}});
  }
  nlohmann::json out{
      {"driver", "virtual"},
      {"serial_number", "virtual"},
      {"model", model_.name},
      {"seed", config_.seed},
      {"clock", write_json(config_.clock)},
      {"tolerance", config_.tolerance},
      {"domains", config_.domains},
      {"output_range", {{"min", -config_.field_range}, {"max", config_.field_range}, {"unit", "V/m"}}},
      {"aggregate_rate", {{"min", min_aggregate_rate}, {"max", max_aggregate_rate}, {"unit", "S/s"}}},
      {"resolution_bits", 16},
      {"channels", std::move(channels)}};
  if (rate_ > 0) out["scan_rate"] = rate_;
  return out;
}

std::vector<recordings::RawColumn> VirtualDevice::columns() const {
  std::vector<recordings::RawColumn> out;
  for (const auto& converter : converters_) out.push_back(converter.column());
  return out;
}

std::array<std::optional<double>, 5> VirtualDevice::noise() const {
  std::array<std::optional<double>, 5> out;
  for (const auto& converter : converters_)
    out[static_cast<std::size_t>(converter.column().channel)] = converter.sensor().noise;
  return out;
}

// What the configuration says, and what the output has done since.
protocols::Past VirtualDevice::past() const {
  const bool known = config_.past.known();
  return protocols::and_then(known ? config_.past : protocols::Past{protocols::PastKind::poled_plus},
                             visited_);
}

void VirtualDevice::remember(double level, double seconds) {
  const double from = visited_.empty() ? 0 : visited_.back().field, slew = (level - from) / seconds;
  // Levels come as multiples of a sample: a line that was cut into rows is the same to rounding.
  constexpr double same = 1e-6;
  if (!visited_.empty() && std::abs(slew - slew_) <= same * std::abs(slew_)) {
    visited_.back().field = level;
    visited_.back().seconds += seconds;
    return;
  }
  slew_ = slew;
  if (visited_.size() <= protocols::most_visited_levels) visited_.push_back({level, seconds});
}

double VirtualDevice::scan_rate(double asked) const {
  const auto columns = static_cast<double>(converters_.size());
  if (asked * columns >= min_aggregate_rate && asked * columns <= max_aggregate_rate) return asked;
  throw Error(
      ErrorCode::invalid_params, "the virtual device cannot scan at this rate",
      Problem{.path = "/sample_rate",
              .message =
                  "is outside the range of the rate with " + std::to_string(converters_.size()) + " channels",
              .given = asked,
              .allowed = {{"from", min_aggregate_rate / columns}, {"to", max_aggregate_rate / columns}},
              .unit = "Hz",
              .hint = "choose a rate in the range, or enable fewer channels"});
}

void VirtualDevice::go_to(double level, double slew) {
  source_ = nullptr;
  rows_ = 0;
  const double duration = std::abs(level - level_) / slew;
  if (duration == 0) return;
  if (config_.clock == Clock::real) std::this_thread::sleep_for(Seconds(duration));
  level_ = level;  // first: the output obeys even if the model fails
  remember(level, duration);
  for (auto& v : values_) v.resize(std::max<std::size_t>(v.size(), 1));
  const double end = simulator_.time() + duration;
  simulator_.play(duration, level, std::span(&end, 1), spans(values_, 0, 1));
  for (std::size_t c = 0; c < last_.size(); ++c) last_[c] = values_[c][0];
}

void VirtualDevice::start(double rate, LevelSource& source) {
  rate_ = scan_rate(rate);
  source_ = &source;
  row_ = 0;
  rows_ = 0;
  const auto chunk = static_cast<std::size_t>(std::clamp(std::floor(rate * chunk_time), 1.0, chunk_rows));
  times_.resize(chunk);
  for (auto& v : values_) v.resize(chunk);
  start_ = std::chrono::steady_clock::now();
}

void VirtualDevice::fill_chunk() {
  std::size_t waiting = 0;
  if (row_ == 0) {
    for (std::size_t c = 0; c < last_.size(); ++c) values_[c][0] = last_[c];
    rows_ = 1;
  }
  while (rows_ < times_.size()) {
    const LinearPiece piece = source_->next(times_.size() - rows_);
    if (piece.samples == 0) break;
    play(piece, rows_);
    rows_ += piece.samples;
    if (piece.waiting) waiting += piece.samples;
  }
  if (rows_ == 0) return;
  for (std::size_t c = 0; c < last_.size(); ++c) last_[c] = values_[c][rows_ - 1];
  due_ = config_.clock == Clock::real
             ? start_ + std::chrono::duration_cast<std::chrono::nanoseconds>(
                            Seconds(static_cast<double>(row_ + rows_ - 1) / rate_))
             : std::chrono::steady_clock::now() + std::chrono::duration_cast<std::chrono::nanoseconds>(
                                                      Seconds(static_cast<double>(waiting) / rate_));
}

void VirtualDevice::play(const LinearPiece& piece, std::size_t at) {
  const std::span times = std::span(times_).first(piece.samples);
  const double now = simulator_.time();
  for (std::size_t i = 0; i < times.size(); ++i) times[i] = now + static_cast<double>(i + 1) / rate_;
  level_ = piece.level;
  remember(level_, static_cast<double>(piece.samples) / rate_);
  simulator_.play(static_cast<double>(piece.samples) / rate_, piece.level, times,
                  spans(values_, at, piece.samples));
}

bool VirtualDevice::read(SampleBlock& block) {
  block.rows = 0;
  block.counts.clear();
  block.status = BlockStatus::ok;
  block.message.clear();
  if (source_ == nullptr) return false;
  if (rows_ == 0) fill_chunk();
  if (rows_ == 0) {
    source_ = nullptr;
    return false;
  }
  const auto now = std::chrono::steady_clock::now();
  std::this_thread::sleep_until(std::min(due_, now + patience));
  if (due_ > now + patience) {
    block.status = BlockStatus::timeout;
    block.message = "the next row is not due yet";
    return true;
  }
  convert(block);
  return true;
}

void VirtualDevice::convert(SampleBlock& block) {
  block.first_sample = row_;
  block.rows = rows_;
  block.counts.resize(rows_ * converters_.size());
  for (std::size_t i = 0; i < converters_.size(); ++i) {
    const auto channel = converters_[i].column().channel;
    const auto values = std::span(values_[static_cast<std::size_t>(channel)]).first(rows_);
    if (!converters_[i].convert(row_, values, block.counts.data() + i, converters_.size())) continue;
    block.status = BlockStatus::clipped;
    block.message += (block.message.empty() ? "" : ", ") + std::string(recordings::channel_name(channel)) +
                     " is past the converter's range";
  }
  row_ += rows_;
  rows_ = 0;
}

}  // namespace ferrobench::daq
