#include "daq/device.h"

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

void SampleBlock::clear() {
  drop_rows();
  status = BlockStatus::ok;
  message.clear();
  command.clear();
  events.clear();
}

}  // namespace ferrobench::daq
