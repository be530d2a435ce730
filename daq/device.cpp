#include "daq/device.h"

#include <algorithm>

namespace ferrobench::daq {

std::string_view block_status_name(BlockStatus status) {
  constexpr std::array<std::string_view, 9> names{
      "ok", "overrun", "underrun", "timeout", "short_data", "stall", "device_lost", "clipped", "misaligned"};
  return names.at(static_cast<std::size_t>(status));
}

std::size_t LevelSource::next_levels(std::span<double> levels) {
  std::size_t rows = 0;
  for (; rows < levels.size(); ++rows) {
    const auto piece = next(1);
    if (piece.samples == 0) break;
    levels[rows] = piece.level;
  }
  return rows;
}

void SampleBlock::drop_rows() {
  rows = 0;
  counts.clear();
  time.clear();
  for (auto& signal : signals) signal.clear();
}

void SampleBlock::select(std::span<const std::uint8_t> which) {
  const auto leave = [&](auto& values) {
    const auto width = rows == 0 ? 0 : values.size() / rows;
    auto to = values.begin();
    for (std::size_t row = 0; row < rows; ++row)
      if (which[row] != 0)
        to = std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(row * width), width, to);
    values.erase(to, values.end());
  };
  leave(counts);
  leave(time);
  leave(command);
  for (auto& signal : signals) leave(signal);
  rows = static_cast<std::size_t>(std::ranges::count_if(which, [](auto wanted) { return wanted != 0; }));
}

void SampleBlock::clear() {
  drop_rows();
  status = BlockStatus::ok;
  message.clear();
  command.clear();
  events.clear();
}

}  // namespace ferrobench::daq
