#include "recordings/format/parts.h"

namespace ferrobench::recordings {

std::optional<Event> loss_of(const Ending& ending, std::uint64_t rows, double last_time) {
  if (ending.rows_lost == 0) return std::nullopt;
  return Event{last_time, "gap",
               std::to_string(ending.rows_lost) + " of " + std::to_string(rows + ending.rows_lost) +
                   " samples are missing: those after this moment were measured and could not be recorded"};
}

Rows Columns::rows() const {
  Rows out{.time = time, .channels = {}, .counts = counts};
  for (std::size_t i = 0; i < channels.size(); ++i) out.channels.at(i) = channels.at(i);
  return out;
}

void Columns::clear() {
  time.clear();
  for (auto& channel : channels) channel.clear();
  counts.clear();
}

bool is_open(const std::string& status) {
  return status == "running" || status == "broken_off";
}

}  // namespace ferrobench::recordings
